"""Number sorting (ReconROS Executor, Section V-A)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def sort(numbers: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the numbers (uint32[n]) in ascending order as a new array; ValueError for any other array.

    Deviation: numpy's sort, not the paper's odd-even transposition network, because the order is the same and
    the model supplies the time that the network takes; the network is the reference in the tests.
    """
    if numbers.ndim != 1 or numbers.dtype != np.uint32:
        raise ValueError(f"numbers of uint32[n] are needed, not {numbers.dtype}{[*numbers.shape]}")
    return np.sort(numbers)
