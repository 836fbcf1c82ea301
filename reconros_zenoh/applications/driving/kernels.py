"""What the nodes compute, on pictures uint8[480, 640, 3] in the order blue, green, red.

The paper says what each node does in a sentence; the details are ours.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from reconros_zenoh.applications.driving.view import (
    HEIGHT,
    WIDTH,
    ground_of_birds_view,
    picture_of_ground,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Picture = NDArray[np.uint8]

LANE_WIDTH = 0.4
"""Between the middles of the lines [m]."""

_OUTLIERS = 0.01
"""The share of the pixels, the darkest and the brightest, that may be outliers."""

_YELLOW = ((20, 100, 100), (35, 255, 255))
_WHITE = ((0, 0, 190), (180, 40, 255))
_LEAST_LIGHT = 60
"""Pixels of a traffic light that is seen."""

_FITS = 3
_LOOK_AHEAD = 0.8
_SPEED = 0.5

# From pixels of the bird's view to those of the camera's picture.
_TO_PICTURE = picture_of_ground() @ ground_of_birds_view()


def compensate(picture: Picture) -> Picture:
    """Return the picture with the median of the neighbours for each pixel that is an outlier."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    shares = np.cumsum(cv2.calcHist([grey], [0], None, [256], [0, 256])) / grey.size
    low, high = np.searchsorted(shares, [_OUTLIERS / 2, 1 - _OUTLIERS / 2])
    usual = cv2.inRange(grey, np.array(low), np.array(high))
    compensated: Any = cv2.copyTo(picture, usual, cv2.medianBlur(picture, 3))
    return compensated  # type: ignore[no-any-return] # as OpenCV's stubs have it


def blur(picture: Picture) -> Picture:
    """Return the picture behind a Gaussian low-pass filter of 5 x 5."""
    smooth: Any = cv2.GaussianBlur(picture, (5, 5), 0)
    return smooth  # type: ignore[no-any-return] # as OpenCV's stubs have it


def plan_lane(picture: Picture) -> Picture:
    """Return the yellow and white pixels as seen from above, uint8[480, 640]: 255, and 0 elsewhere."""
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    yellow, white = (cv2.inRange(hsv, np.array(low), np.array(high)) for low, high in (_YELLOW, _WHITE))
    above: Any = cv2.warpPerspective(
        cv2.bitwise_or(yellow, white),
        _TO_PICTURE,
        (WIDTH, HEIGHT),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
    )
    return above  # type: ignore[no-any-return]


def fit_lane(lines: Picture) -> tuple[float, float, float, int]:
    """Return offset, slope, curvature and pixels of `Lane.msg` by least squares, from the bird's view."""
    found: Any = cv2.findNonZero(lines)
    if found is None:
        return 0.0, 0.0, 0.0, 0
    columns, rows = found.reshape(-1, 2).T
    x, y, _ = ground_of_birds_view() @ np.stack([columns, rows, np.ones(len(rows))])
    powers = np.stack([np.ones_like(x), x, x * x])
    lane = np.zeros(3)
    for _ in range(_FITS):  # which line a pixel belongs to, by the lane so far
        to_middle = y - np.copysign(LANE_WIDTH / 2, y - lane @ powers)
        lane = np.linalg.lstsq(powers @ powers.T, powers @ to_middle, rcond=None)[0]
    offset, slope, curvature = lane.tolist()
    return offset, slope, curvature, len(rows)


def shows_red(picture: Picture) -> bool:
    """Tell whether a red traffic light is in the picture."""
    red = cv2.inRange(picture, np.array((0, 0, 180)), np.array((90, 90, 255)))
    return cv2.countNonZero(red) >= _LEAST_LIGHT


def lets_pass(picture: Picture) -> bool:
    """Tell whether the traffic light is green, or none is in sight.

    Deviation: the paper says green only. A robot that has rolled past the light, or is put back to the start,
    would stand for ever.
    """
    return not shows_red(picture)


def steer(offset: float, slope: float, curvature: float) -> tuple[float, float]:
    """Return speed [m/s] and turn [rad/s] towards a point of the lane ahead (pure pursuit)."""
    aside = offset + slope * _LOOK_AHEAD + curvature * _LOOK_AHEAD**2
    return _SPEED, _SPEED * 2 * aside / (_LOOK_AHEAD**2 + aside**2)


def find_key_points(picture: Picture) -> NDArray[np.uint8]:
    """Return the descriptors of the picture's ORB key points, uint8[n, 32]."""
    found: Any = cv2.ORB.create(500).detectAndCompute(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), None)[1]
    return np.zeros((0, 32), np.uint8) if found is None else found


def match_key_points(before: NDArray[np.uint8], now: NDArray[np.uint8]) -> int:
    """Return how many key points are in both pictures."""
    if not (len(before) and len(now)):
        return 0
    return len(cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(before, now))
