"""Sobel filter of a three-channel image (ReconROS Executor, Section V-A)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHAPE = (480, 640, 3)
# Gradients of a strip stay in the cache; those of the whole image would need fresh pages at every call.
STRIP_ROWS = 60


def sobel(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return (|gx| + |gy|) >> 3 of each channel as a new uint8[480, 640, 3]; the border is zero.

    gy is the response to the kernel [1 2 1; 0 0 0; -1 -2 -1], gx to its transpose; the shift brings the
    largest sum, 2040, to 255. OpenCV's kernels have the other sign, which the absolute value removes.
    ValueError if `image` is not uint8[480, 640, 3].
    """
    if image.shape != SHAPE or image.dtype != np.uint8:
        raise ValueError(f"an image of uint8{[*SHAPE]} is needed, not {image.dtype}{[*image.shape]}")
    edges = np.zeros(SHAPE, np.uint8)
    for top in range(0, SHAPE[0] - 2, STRIP_ROWS):
        strip = image[top : top + STRIP_ROWS + 2]
        gx = cv2.Sobel(strip, cv2.CV_16S, 1, 0)
        gy = cv2.Sobel(strip, cv2.CV_16S, 0, 1)
        magnitude = np.abs(gx, out=gx)
        magnitude += np.abs(gy, out=gy)
        magnitude >>= 3
        edges[top + 1 : top + len(strip) - 1, 1:-1] = magnitude[1:-1, 1:-1]
    return edges
