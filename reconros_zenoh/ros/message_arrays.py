"""The arrays of numbers in a message."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

Array: TypeAlias = "np.ndarray[Any, Any]"


def arrays_of(message: object) -> Iterator[Array]:
    """Yield the arrays of numbers of a message, with those of the messages in it."""
    if isinstance(message, np.ndarray):
        yield message
    elif isinstance(message, list):
        for element in message:
            yield from arrays_of(element)
    elif is_dataclass(message):
        for field in fields(message):
            yield from arrays_of(getattr(message, field.name))


def lies_in(part: Array, whole: Array) -> bool:
    """Tell whether no byte of `part` is before the first or behind the last one of `whole`."""
    first, last = _bounds(part)
    begin, end = _bounds(whole)
    return begin <= first and last <= end


def _bounds(array: Array) -> tuple[int, int]:
    # numpy has this as byte_bounds, in another place in each version.
    first = last = array.__array_interface__["data"][0]
    for length, stride in zip(array.shape, array.strides, strict=True):
        first += min(0, (length - 1) * stride)
        last += max(0, (length - 1) * stride)
    return first, last + array.itemsize
