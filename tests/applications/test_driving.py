"""The driving example: what its nodes compute, and the world that they see."""

from __future__ import annotations

import numpy as np
import pytest

from reconros_zenoh.applications.driving.kernels import (
    LANE_WIDTH,
    blur,
    compensate,
    find_key_points,
    fit_lane,
    lets_pass,
    match_key_points,
    plan_lane,
    shows_red,
    steer,
)
from reconros_zenoh.applications.driving.view import (
    HEIGHT,
    WIDTH,
    ground_of_birds_view,
    horizon,
    picture_of_ground,
    pixel_of,
)
from reconros_zenoh.applications.driving.world import GREEN_S, RADIUS, RED_S, Robot, World, is_red

WORLD = World()


def lane_of(robot: Robot) -> tuple[float, float, float, int]:
    """Return what the chain of nodes makes of the robot's picture."""
    return fit_lane(plan_lane(blur(compensate(WORLD.picture(robot, 0.0, 0)))))


def test_a_point_on_the_ground_is_where_the_homography_says() -> None:
    for x, y in ((0.5, 0.1), (1.5, -0.4), (3.0, 0.0)):
        column, row, depth = picture_of_ground() @ (x, y, 1)
        assert pixel_of(x, y, 0.0) == pytest.approx((column / depth, row / depth, depth))
    assert pixel_of(1e9, 0.0, 0.0)[1] == pytest.approx(horizon())


def test_the_birds_view_begins_before_the_robot_and_looks_ahead() -> None:
    near_middle, far_left = (
        ground_of_birds_view() @ (column, row, 1) for column, row in ((WIDTH / 2, HEIGHT), (0, 0))
    )
    assert near_middle == pytest.approx((0.35, 0.0, 1))
    assert far_left == pytest.approx((1.55, 0.8, 1))


def test_compensation_takes_the_noise_away() -> None:
    robot = Robot.after(1.2)
    noisy, other = (WORLD.picture(robot, 0.0, number) for number in (0, 1))
    assert np.count_nonzero(noisy != other) > 1000
    assert np.count_nonzero(compensate(noisy) != compensate(other)) < 100


@pytest.mark.parametrize("metres", [0.0, 5.0, 20.0])
def test_the_lane_is_seen_as_it_lies(metres: float) -> None:
    offset, slope, curvature, pixels = lane_of(Robot.after(metres))
    assert pixels > 5000
    assert offset == pytest.approx(0, abs=0.01)
    assert slope == pytest.approx(0, abs=0.03)
    # A circle near its tangent.
    assert curvature == pytest.approx(1 / (2 * RADIUS), abs=0.02)


def test_a_robot_on_the_right_sees_the_lane_on_its_left() -> None:
    robot = Robot(RADIUS + 0.08, 0.0)
    offset, *_ = lane_of(robot)
    assert offset == pytest.approx(robot.off_lane, abs=0.015)
    assert steer(offset, 0.0, 0.0)[1] > 0  # to the left


def test_without_lines_there_is_no_lane() -> None:
    assert fit_lane(np.zeros((HEIGHT, WIDTH), np.uint8)) == (0.0, 0.0, 0.0, 0)
    assert lane_of(Robot(RADIUS + 10 * LANE_WIDTH, 0.0))[3] == 0


def test_a_lane_straight_ahead_needs_no_turn() -> None:
    assert steer(0.0, 0.0, 0.0) == (0.5, 0.0)
    speed, turn = steer(0.0, 0.0, 1 / (2 * RADIUS))
    assert turn == pytest.approx(speed / RADIUS, rel=0.05)


def test_the_light_is_seen_only_near_and_in_its_colour() -> None:
    for metres, seen in ((0.0, False), (1.2, True), (3.0, False)):
        red, green = (compensate(WORLD.picture(Robot.after(metres), s, 0)) for s in (0.0, RED_S))
        assert (shows_red(red), lets_pass(red)) == (seen, not seen)
        assert (shows_red(green), lets_pass(green)) == (False, True)
        assert np.any(red != green) == seen


@pytest.mark.parametrize("turn", [0, 1, 7])
def test_the_light_changes_for_ever(turn: int) -> None:
    begin = turn * (RED_S + GREEN_S)
    assert [is_red(begin + seconds) for seconds in (0, RED_S - 0.1, RED_S, RED_S + GREEN_S - 0.1)] == [
        True,
        True,
        False,
        False,
    ]


def test_the_filter_takes_the_edges_off() -> None:
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    picture[:, WIDTH // 2 :] = 255
    assert np.abs(np.diff(blur(picture).astype(int), axis=1)).max() < 128
    assert np.array_equal(blur(picture)[:, :100], picture[:, :100])


def test_key_points_of_a_picture_are_found_again() -> None:
    found = find_key_points(WORLD.picture(Robot(), 0.0, 0))
    assert found.shape == (len(found), 32)
    # Windows look alike, and of two that do only one is found.
    assert 0.9 * len(found) < match_key_points(found, found) <= len(found)
    assert len(found) > 100
    none = find_key_points(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    assert match_key_points(none, found) == 0


def test_a_robot_that_turns_comes_back() -> None:
    robot = Robot(speed=0.5, turn=0.5 / RADIUS)
    for _ in range(1000):
        robot.move(2 * np.pi * RADIUS / 0.5 / 1000)
        assert robot.off_lane == pytest.approx(0, abs=1e-4)
    assert (robot.x, robot.y) == pytest.approx((RADIUS, 0), abs=1e-6)
    half_way = Robot.after(np.pi * RADIUS)
    assert (half_way.x, half_way.y, half_way.off_lane) == pytest.approx((-RADIUS, 0, 0))
