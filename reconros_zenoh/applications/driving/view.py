"""How the robot's camera sees the ground: the geometry that the world and the lane planner share.

Ground coordinates [m] have their origin below the camera, x ahead and y to the left. All figures are assumed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]

HEIGHT, WIDTH = 480, 640
FOCAL_LENGTH = 500.0
CAMERA_HEIGHT = 0.3
PITCH = np.radians(15.0)
"""How far the camera looks down."""

# The piece of ground in the bird's view, which has as many pixels as a picture.
NEAR, LEFT = 0.35, 0.8
PIXELS_PER_METRE = 400.0

_SIN, _COS = float(np.sin(PITCH)), float(np.cos(PITCH))


def horizon() -> float:
    """Return the row of the camera's picture in which the ground ends."""
    return HEIGHT / 2 - FOCAL_LENGTH * _SIN / _COS


def picture_of_ground() -> Matrix:
    """Return the homography (3 x 3) from ground coordinates to column and row of the camera's picture."""
    depth = np.array([_COS, 0.0, CAMERA_HEIGHT * _SIN])
    right = np.array([0.0, -1.0, 0.0])
    down = np.array([-_SIN, 0.0, CAMERA_HEIGHT * _COS])
    return np.stack(
        [FOCAL_LENGTH * right + WIDTH / 2 * depth, FOCAL_LENGTH * down + HEIGHT / 2 * depth, depth]
    )


def ground_of_birds_view() -> Matrix:
    """Return the homography (3 x 3) from column and row of the bird's view to ground coordinates."""
    far = NEAR + HEIGHT / PIXELS_PER_METRE
    return np.array([[0, -1 / PIXELS_PER_METRE, far], [-1 / PIXELS_PER_METRE, 0, LEFT], [0, 0, 1]])


def pixel_of(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return column, row and depth [m] of a point `z` above the ground."""
    depth = x * _COS + (CAMERA_HEIGHT - z) * _SIN
    down = (CAMERA_HEIGHT - z) * _COS - x * _SIN
    return WIDTH / 2 - FOCAL_LENGTH * y / depth, HEIGHT / 2 + FOCAL_LENGTH * down / depth, depth
