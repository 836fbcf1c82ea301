"""Kernels that tell how often they were called, and what they may be given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable


class Counting:
    """A kernel that counts its calls."""

    def __init__(self, kernel: Callable[..., Any]) -> None:
        self.calls = 0
        self._kernel = kernel

    def __call__(self, *arguments: Any) -> Any:
        self.calls += 1
        return self._kernel(*arguments)


def read_only(content: Any) -> Any:
    array = np.array(content)
    array.setflags(write=False)
    return array
