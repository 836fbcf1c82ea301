"""The parts of the design example that need no board: controller, platform and test picture."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.applications.design_example.control.plant import (
    LARGEST_TILT,
    SAMPLES_PER_SIDE,
    SETPOINT,
    Pid,
    Platform,
    command,
    setpoint,
)
from reconros_zenoh.applications.design_example.picture import FRAMES, moving_picture
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics, unpack


def servo_index(tilt: float) -> int:
    return inverse_kinematics(command(tilt)) >> 21


def test_the_loop_settles_where_it_shall() -> None:
    pid, platform = Pid(), Platform()
    tilt = platform.move()
    assert tilt == pytest.approx(0.0, abs=0.1)
    for _ in range(SAMPLES_PER_SIDE):
        platform.target = servo_index(pid.output(SETPOINT - tilt))
        tilt = platform.move()
    assert tilt == pytest.approx(SETPOINT, abs=0.1)


@pytest.mark.parametrize("tilt", [-8.0, -1.0, 0.0, 3.5, 9.0])
def test_the_platform_goes_to_the_tilt_whose_servo_index_it_is_given(tilt: float) -> None:
    platform = Platform()
    platform.target = servo_index(tilt)
    for _ in range(30):
        reached = platform.move()
    assert reached == pytest.approx(tilt, abs=0.1)


@given(st.lists(st.floats(-1000, 1000)))
def test_whatever_the_errors_the_command_is_one_that_the_platform_can_follow(errors: list[float]) -> None:
    pid = Pid()
    for error in errors:
        output = pid.output(error)
        assert abs(output) <= LARGEST_TILT
        assert unpack(command(output)).leg == 0


def test_the_integral_does_not_grow_while_the_output_is_limited() -> None:
    pid = Pid()
    for _ in range(1000):
        assert pid.output(100.0) == LARGEST_TILT
    for _ in range(3):
        output = pid.output(-5.0)
    assert output < 0


def test_the_setpoint_changes_sides() -> None:
    assert [setpoint(sample) for sample in (0, SAMPLES_PER_SIDE, 2 * SAMPLES_PER_SIDE)] == [
        SETPOINT,
        -SETPOINT,
        SETPOINT,
    ]


def test_the_picture_moves_and_begins_again() -> None:
    pictures = [moving_picture(index) for index in range(FRAMES)]
    assert all(not np.array_equal(*pair) for pair in pairwise(pictures))
    assert np.array_equal(moving_picture(FRAMES), pictures[0])
