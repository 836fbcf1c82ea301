"""What the clients send: test inputs drawn from a seeded generator, the same for the same seed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from reconros_zenoh.applications.roundtrip.kernels.inverse import LEGS, STEPS_PER_DEGREE, pack
from reconros_zenoh.applications.roundtrip.kernels.mnist import load_digits
from reconros_zenoh.applications.roundtrip.kernels.sobel import SHAPE

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

LARGEST_ROTATION = 10 * STEPS_PER_DEGREE
NUMBERS = 2048
DISCS = 6
NOISE = 12
SAMPLE = Path(__file__).parent / "data" / "digits.npz"


def angles(rng: Generator, count: int) -> NDArray[np.uint32]:
    """Return `count` packed requests for the inverse kinematics: any leg, rotations of -10 to 10 degrees."""
    legs = rng.integers(LEGS, size=count).tolist()
    rotations = rng.integers(-LARGEST_ROTATION, LARGEST_ROTATION, size=(count, 2)).tolist()
    return np.array([pack(leg, *pair) for leg, pair in zip(legs, rotations, strict=True)], dtype=np.uint32)


def images(rng: Generator, count: int) -> NDArray[np.uint8]:
    """Return `count` frames (uint8[count, 480, 640, 3], bgr8): discs drift over a shaded, noisy ground."""
    height, width, channels = SHAPE
    corners = rng.integers(40, 216, size=(2, 2, channels), dtype=np.uint8)
    ground = cv2.resize(corners, (width, height), interpolation=cv2.INTER_LINEAR)
    centres = rng.uniform((0, 0), (width, height), size=(DISCS, 2))
    steps = rng.uniform(-12, 12, size=(DISCS, 2))
    radii = rng.integers(20, 90, size=DISCS).tolist()
    colours = rng.integers(256, size=(DISCS, channels)).tolist()
    frames = np.empty((count, *SHAPE), np.uint8)
    for index, frame in enumerate(frames):
        frame[:] = ground
        places = np.mod(centres + index * steps, (width, height)).astype(int).tolist()
        for place, radius, colour in zip(places, radii, colours, strict=True):
            cv2.circle(frame, place, radius, colour, thickness=cv2.FILLED, lineType=cv2.LINE_AA)
        cv2.add(frame, rng.integers(NOISE, size=SHAPE, dtype=np.uint8), dst=frame)
    return frames


def numbers(rng: Generator, count: int) -> NDArray[np.uint32]:
    """Return `count` requests for the sorter: uint32[count, 2048], each number equally likely."""
    return rng.integers(1 << 32, size=(count, NUMBERS), dtype=np.uint32)


def digits() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the shipped sample, the first 200 MNIST test digits: uint8[200, 28, 28], labels uint8[200]."""
    return load_digits(SAMPLE)
