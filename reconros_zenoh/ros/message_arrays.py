"""The arrays of numbers in a message: which there are, where they lie, and who can change them."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

Array: TypeAlias = "np.ndarray[Any, Any]"
T = TypeVar("T")


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


def is_unchanging(array: Array) -> bool:
    """Tell whether nobody can write to the array, nor to what it is a view of."""
    memory: object = array
    while isinstance(memory, np.ndarray):
        if memory.flags.writeable:
            return False
        memory = memory.base
    return memory is None or isinstance(memory, bytes) or (isinstance(memory, memoryview) and memory.readonly)


def snapshot(value: T) -> T:
    """Return the message, array or list of them as it is now and stays: its arrays are read-only.

    Arrays that nobody can change are handed over by reference, all others are copied.
    """
    copy: object = value
    if isinstance(value, np.ndarray):
        if not is_unchanging(value):
            copy = value.copy()
            copy.flags.writeable = False
    elif isinstance(value, list):
        copy = [snapshot(element) for element in value]
    elif is_dataclass(value) and not isinstance(value, type):
        copy = type(value)(**{field.name: snapshot(getattr(value, field.name)) for field in fields(value)})
    return cast("T", copy)


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
