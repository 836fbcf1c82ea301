"""The test picture: a disc on a circle before a shaded ground, and a bar that sweeps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from reconros_zenoh.applications.roundtrip.kernels.sobel import SHAPE

if TYPE_CHECKING:
    from numpy.typing import NDArray

FRAMES = 50
"""After so many the movement repeats."""


def moving_picture(index: int) -> NDArray[np.uint8]:
    """Return picture number `index` (uint8[480, 640, 3], bgr8); the same number gives the same picture."""
    height, width, channels = SHAPE
    phase = index % FRAMES / FRAMES
    shade = np.linspace(0, 90, width).astype(np.uint8)
    picture = np.repeat(np.tile(shade, (height, 1))[..., np.newaxis], channels, axis=2)
    turn = 2 * np.pi * phase
    centre = (round(width / 2 + 200 * np.cos(turn)), round(height / 2 + 140 * np.sin(turn)))
    left = round(phase * width)
    cv2.rectangle(picture, (left, 0), (left + 24, height), (255, 150, 0), cv2.FILLED)
    cv2.circle(picture, centre, 70, (240, 255, 255), cv2.FILLED, cv2.LINE_AA)
    return picture
