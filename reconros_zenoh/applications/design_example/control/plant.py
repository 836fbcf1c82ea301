"""The controlled platform and its controller: a Stewart platform of which leg 0 is moved about the x-axis.

Angles are rotations of the platform in degrees. All constants are assumed: the paper gives none.
"""

from __future__ import annotations

import numpy as np

from reconros_zenoh.applications.roundtrip.kernels.inverse import (
    STEPS_PER_DEGREE,
    inverse_kinematics,
    pack,
)

LEG = 0
LARGEST_TILT = 10.0
SETPOINT = 5.0
SAMPLES_PER_SIDE = 30
"""How many samples the platform shall lean to one side before it leans to the other."""

_KP, _KI, _KD = 0.3, 0.3, 0.02
_MOTOR_STEP = 0.6
"""The share of its way that the servo arm goes from one sample to the next."""

_TILTS = np.linspace(-LARGEST_TILT, LARGEST_TILT, 161)


class Pid:
    """A discrete PID controller with limited output and an integral that stops there (anti-windup)."""

    def __init__(self) -> None:
        self._integral = 0.0
        self._last_error: float | None = None

    def output(self, error: float) -> float:
        """Return the angle to command after this sample's error."""
        change = 0.0 if self._last_error is None else error - self._last_error
        self._last_error = error
        wanted = _KP * error + self._integral + _KI * error + _KD * change
        if abs(wanted) < LARGEST_TILT:
            self._integral += _KI * error
        return min(max(wanted, -LARGEST_TILT), LARGEST_TILT)


class Platform:
    """The servo arm of leg 0 and the tilt that it gives: the inverse of the inverse kinematics."""

    def __init__(self) -> None:
        self._indices = np.array(
            [inverse_kinematics(command(tilt)) >> 21 for tilt in _TILTS.tolist()], np.float64
        )
        self.target = self.arm = self._index(0.0)

    def move(self) -> float:
        """Let one sample's time pass and return the tilt."""
        self.arm += _MOTOR_STEP * (self.target - self.arm)
        # The index falls as the tilt grows; `interp` wants it rising.
        return float(np.interp(self.arm, self._indices[::-1], _TILTS[::-1]))

    def _index(self, tilt: float) -> float:
        return float(np.interp(tilt, _TILTS, self._indices))


def command(tilt: float) -> int:
    """Return the request to the inverse kinematics for this tilt."""
    return pack(LEG, round(tilt * STEPS_PER_DEGREE), 0)


def setpoint(sample: int) -> float:
    """Return the angle that the platform shall have: it leans to one side, then to the other."""
    return SETPOINT if sample // SAMPLES_PER_SIDE % 2 == 0 else -SETPOINT
