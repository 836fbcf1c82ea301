"""The world that the robot drives in: a round lane, a traffic light beside it, houses around."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Self

import cv2
import numpy as np

from reconros_zenoh.applications.driving.kernels import LANE_WIDTH
from reconros_zenoh.applications.driving.view import (
    FOCAL_LENGTH,
    HEIGHT,
    WIDTH,
    horizon,
    picture_of_ground,
    pixel_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

RADIUS = 4.0
"""Of the middle of the lane [m], around (0, 0), driven counter-clockwise."""

RED_S, GREEN_S = 5.0, 5.0
_LIGHT_AT = 3.0  # along the lane from the start [m]
_LIGHT_SEEN = (0.9, 2.5)  # ahead [m]
_LIGHT_ASIDE, _LIGHT_HEIGHT, _LIGHT_RADIUS = 0.5, 0.45, 0.05
_LINE_WIDTH = 0.04
_SHOULDER = 0.1

_GRASS, _ROAD, _YELLOW, _WHITE = (40, 80, 40), (70, 70, 70), (0, 200, 255), (235, 235, 235)
_SKY, _POST, _RED, _GREEN = (190, 160, 130), (30, 30, 30), (20, 20, 255), (20, 255, 20)
_NOISE = 0.001
"""The share of pixels that a picture has wrong."""

_HOUSES = 40


@dataclass
class Robot:
    """Where the robot is [m] and looks to [rad], and what it does [m/s, rad/s]; it begins in the lane."""

    x: float = RADIUS
    y: float = 0.0
    heading: float = np.pi / 2
    speed: float = 0.0
    turn: float = 0.0

    @classmethod
    def after(cls, metres: float) -> Self:
        """Return a robot that stands in the middle of the lane, so far from the start."""
        angle = metres / RADIUS
        return cls(RADIUS * float(np.cos(angle)), RADIUS * float(np.sin(angle)), angle + np.pi / 2)

    def move(self, seconds: float) -> None:
        """Let time pass: the robot goes on along an arc."""
        middle = self.heading + self.turn * seconds / 2
        self.x += self.speed * seconds * np.cos(middle)
        self.y += self.speed * seconds * np.sin(middle)
        self.heading += self.turn * seconds

    @property
    def off_lane(self) -> float:
        """How far it is from the middle of the lane [m], to the right positive."""
        return float(np.hypot(self.x, self.y)) - RADIUS


class World:
    """Takes the pictures of the robot's camera; the same place, time and number give the same picture."""

    def __init__(self) -> None:
        first = int(np.ceil(horizon())) + 1
        columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(first, HEIGHT))
        ones = np.ones(columns.size)
        ground = np.linalg.inv(picture_of_ground()) @ np.stack([columns.ravel(), rows.ravel(), ones])
        self._first = first
        self._ahead = (ground[0] / ground[2]).reshape(columns.shape)
        self._aside = (ground[1] / ground[2]).reshape(columns.shape)
        self._panorama = _panorama(first)

    def picture(self, robot: Robot, seconds: float, number: int) -> NDArray[np.uint8]:
        """Return what the robot sees (uint8[480, 640, 3], blue, green, red)."""
        picture = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        turned = round(-robot.heading * FOCAL_LENGTH)
        picture[: self._first] = np.take(
            self._panorama, np.arange(turned, turned + WIDTH), axis=1, mode="wrap"
        )
        picture[self._first :] = self._ground(robot)
        self._add_light(picture, robot, seconds)
        random = np.random.default_rng(number)
        wrong = random.integers(0, HEIGHT * WIDTH, round(_NOISE * HEIGHT * WIDTH))
        picture.reshape(-1, 3)[wrong] = random.choice(np.array([0, 255], np.uint8), (len(wrong), 1))
        return picture

    def _ground(self, robot: Robot) -> NDArray[np.uint8]:
        cos, sin = np.cos(robot.heading), np.sin(robot.heading)
        off_lane = (
            np.hypot(
                robot.x + self._ahead * cos - self._aside * sin,
                robot.y + self._ahead * sin + self._aside * cos,
            )
            - RADIUS
        )
        kind = np.zeros(off_lane.shape, np.intp)
        kind[np.abs(off_lane) < LANE_WIDTH / 2 + _SHOULDER] = 1
        kind[np.abs(off_lane + LANE_WIDTH / 2) < _LINE_WIDTH / 2] = 2
        kind[np.abs(off_lane - LANE_WIDTH / 2) < _LINE_WIDTH / 2] = 3
        return np.array([_GRASS, _ROAD, _YELLOW, _WHITE], np.uint8)[kind]

    def _add_light(self, picture: NDArray[np.uint8], robot: Robot, seconds: float) -> None:
        angle = _LIGHT_AT / RADIUS
        away = RADIUS + _LIGHT_ASIDE
        dx, dy = away * np.cos(angle) - robot.x, away * np.sin(angle) - robot.y
        cos, sin = np.cos(robot.heading), np.sin(robot.heading)
        ahead, aside = float(dx * cos + dy * sin), float(dy * cos - dx * sin)
        if not _LIGHT_SEEN[0] < ahead < _LIGHT_SEEN[1]:
            return
        column, row, depth = pixel_of(ahead, aside, _LIGHT_HEIGHT)
        _, foot, _ = pixel_of(ahead, aside, 0.0)
        centre, thick = (round(column), round(row)), max(1, round(0.02 * FOCAL_LENGTH / depth))
        cv2.line(picture, centre, (round(column), round(foot)), _POST, thick)
        colour = _RED if is_red(seconds) else _GREEN
        cv2.circle(picture, centre, round(_LIGHT_RADIUS * FOCAL_LENGTH / depth), colour, cv2.FILLED)


def is_red(seconds: float) -> bool:
    """Tell whether the traffic light is red then."""
    return seconds % (RED_S + GREEN_S) < RED_S


def _panorama(height: int) -> NDArray[np.uint8]:
    """Return houses in all directions, one column for each 1/500 of a radian."""
    panorama = np.full((height, round(2 * np.pi * FOCAL_LENGTH), 3), _SKY, np.uint8)
    random = np.random.default_rng(0)
    for left in np.linspace(0, panorama.shape[1], _HOUSES, endpoint=False).astype(int).tolist():
        top, width = int(random.integers(0, height * 2 // 3)), int(random.integers(30, 75))
        shade = int(random.integers(50, 130))
        panorama[top:, left : left + width] = (shade, shade + 10, shade + 20)
        for column, row in product(range(left + 6, left + width - 6, 12), range(top + 8, height, 16)):
            panorama[row : row + 8, column : column + 6] = shade // 2
    return panorama
