"""Inverse kinematics of a Stewart platform: the servo angle of one leg for a wanted platform orientation.

ReconROS Executor, Section V-A. Geometry, bit fields and the search are those of the authors' application. It
counts 1/256 of a degree in its 14 bit input fields, where the paper says Q8.6, and answers an 11 bit index,
where the paper says 10 bits. All lengths are in millimetres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

LEGS = 6
ANGLE_MIN = -(1 << 13)
ANGLE_MAX = (1 << 13) - 1
STEPS_PER_DEGREE = 1 << 8
SERVO_INDICES = 1 << 11
SERVO_STEPS_PER_DEGREE = 10

PLATFORM_X = (51.0, -51.0, -64.0, -13.0, 13.0, 64.0)
PLATFORM_Y = (44.0, 44.0, 22.0, -66.0, -66.0, 22.0)
PLATFORM_HEIGHT = 105.0
# Rotation of each leg's servo frame about z: 0, 0, 240, 240, 120 and 120 degrees.
FRAME_SIN = (0.0, 0.0, -0.8660254, -0.8660254, 0.8660254, 0.8660254)
FRAME_COS = (1.0, 1.0, -0.5, -0.5, -0.5, -0.5)
# Neighbouring servos are mounted as mirror images.
AXIS_SIGN_X = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
AXIS_SIGN_Z = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
SERVO_ORIGIN_X = 33.0
SERVO_ORIGIN_Y = -69.0
LEG_LENGTH = 115.0
ARM_LENGTH = 20.0

_ANGLES = np.radians(np.arange(SERVO_INDICES) / SERVO_STEPS_PER_DEGREE)
# The arm's tip in the servo frame for each servo index; its y is 0.
ARM_TIP_X = ARM_LENGTH * np.sin(_ANGLES)
ARM_TIP_Z = ARM_LENGTH * np.cos(_ANGLES)


class Pose(NamedTuple):
    """A wanted orientation of the platform and the leg to move: rotations about x and y in 1/256 degree."""

    leg: int
    alpha_q: int
    beta_q: int


def pack(leg: int, alpha_q: int, beta_q: int) -> int:
    """Return the 32 bit request: bits 30..17 `alpha_q`, 16..3 `beta_q` (signed, 14 bits), 2..0 `leg`.

    `alpha_q` and `beta_q` are the rotations about x and y in 1/256 degree. ValueError if one does not fit.
    """
    if not 0 <= leg < LEGS:
        raise ValueError(f"leg {leg} does not exist; the platform has the legs 0 to {LEGS - 1}")
    for name, angle in (("alpha_q", alpha_q), ("beta_q", beta_q)):
        if not ANGLE_MIN <= angle <= ANGLE_MAX:
            raise ValueError(f"{name} {angle} does not fit in 14 bits: {ANGLE_MIN} to {ANGLE_MAX}")
    return (alpha_q & 0x3FFF) << 17 | (beta_q & 0x3FFF) << 3 | leg


def unpack(word: int) -> Pose:
    """Return the fields that `pack` put into `word`; bit 31 is ignored, ValueError if the leg is not 0..5."""
    leg = word & 0x7
    if leg >= LEGS:
        raise ValueError(f"leg {leg} does not exist; the platform has the legs 0 to {LEGS - 1}")
    return Pose(leg, _signed(word >> 17), _signed(word >> 3))


def _signed(field: int) -> int:
    """Return the lowest 14 bits as a two's complement number."""
    return ((field + 0x2000) & 0x3FFF) - 0x2000


def inverse_kinematics(word: int) -> int:
    """Return the answer to the request `word` (see `pack`): bits 31..21 servo index, 20..18 leg, others zero.

    The servo index counts 0.1 degree, 0..2047. It is the one whose arm tip is nearest to one leg length from
    the platform's joint (least |distance^2 - leg^2|); the lowest of equals. ValueError if leg is not 0..5.
    """
    leg, alpha_q, beta_q = unpack(word)
    x, y, z = _joint_in_servo_frame(leg, alpha_q, beta_q)
    # |joint - tip|^2 - leg^2, multiplied out: the tips lie on a circle, so only the mixed terms vary.
    constant = x * x + y * y + z * z + ARM_LENGTH**2 - LEG_LENGTH**2
    error = np.abs(constant - 2 * x * ARM_TIP_X - 2 * z * ARM_TIP_Z)
    return int(np.argmin(error)) << 21 | leg << 18


def _joint_in_servo_frame(leg: int, alpha_q: int, beta_q: int) -> tuple[float, float, float]:
    """Return x, y, z of the leg's platform joint as the leg's servo sees it."""
    alpha = math.radians(alpha_q / STEPS_PER_DEGREE)
    beta = math.radians(beta_q / STEPS_PER_DEGREE)
    px, py = PLATFORM_X[leg], PLATFORM_Y[leg]
    x = math.cos(beta) * px
    y = math.sin(alpha) * math.sin(beta) * px + math.cos(alpha) * py
    z = -math.cos(alpha) * math.sin(beta) * px + math.sin(alpha) * py + PLATFORM_HEIGHT
    sin, cos = FRAME_SIN[leg], FRAME_COS[leg]
    return (
        AXIS_SIGN_X[leg] * (cos * x - sin * y) + SERVO_ORIGIN_X,
        sin * x + cos * y + SERVO_ORIGIN_Y,
        AXIS_SIGN_Z[leg] * z,
    )
