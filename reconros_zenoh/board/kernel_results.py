"""What pure kernels have computed: with equal inputs they need not compute it again."""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
import xxhash

from reconros_zenoh.ros.message_arrays import snapshot

if TYPE_CHECKING:
    from collections.abc import Callable

R = TypeVar("R")
_VALUES = (int, str, bytes, np.generic, type(None))


class KernelResults:
    """The results of pure kernels that were asked for last, so many at most; for any thread."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: OrderedDict[object, object] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, kernel: Callable[..., R], *arguments: object) -> R:
        """Return `kernel(*arguments)`, computed unless it is known; of what may change it never is."""
        try:
            key = (kernel, *(_identity(argument) for argument in arguments))
            hash(key)
        except TypeError:
            key = None
        if key is None:  # not above: what the kernel raises would name the TypeError as its context
            return computed(kernel, *arguments)
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]  # type: ignore[return-value] # stored below under the same kernel
        result = computed(kernel, *arguments)
        with self._lock:
            self._kept[key] = result
            if len(self._kept) > self._most:
                self._kept.popitem(last=False)
        return result


def computed(kernel: Callable[..., R], *arguments: object) -> R:
    """Return `kernel(*arguments)`, computed now; its arrays are read-only."""
    return _frozen(kernel(*arguments), arguments)


def _frozen(result: R, arguments: tuple[object, ...]) -> R:
    """Return a result whose arrays nobody can change; one that the kernel has made need not be copied."""
    if type(result) is tuple:
        elements = cast("tuple[object, ...]", result)
        return cast("R", tuple(_frozen(element, arguments) for element in elements))
    if not isinstance(result, np.ndarray):
        return result
    if result.base is None and all(result is not argument for argument in arguments):
        result.flags.writeable = False
    return cast("R", snapshot(result))


class _Unchanging:
    """An array that owns its content and cannot be written: it is equal to itself, whatever it holds."""

    __slots__ = ("_array",)

    def __init__(self, array: np.ndarray[Any, Any]) -> None:
        self._array = array

    def __hash__(self) -> int:
        return id(self._array)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Unchanging) and other._array is self._array


def is_constant(argument: object) -> bool:
    """Whether the argument is an array that nobody can change."""
    return isinstance(argument, np.ndarray) and argument.base is None and not argument.flags.writeable


def _identity(argument: object) -> object:
    """Return something equal for equal arguments: arrays by shape, type and a hash of their content.

    Numbers of different types are different, as a kernel may overflow with one of them, and so are both
    zeros, as `atan2` tells them apart. Raise TypeError for what may change while it stays equal to itself.
    """
    if isinstance(argument, np.ndarray):
        if is_constant(argument):
            return _Unchanging(argument)
        content = np.ascontiguousarray(argument)
        return argument.shape, argument.dtype, xxhash.xxh3_128_digest(content.data)
    if isinstance(argument, float | complex | np.inexact):  # by its bytes: -0.0 is equal to 0.0
        return type(argument), np.array(argument).tobytes()
    if not isinstance(argument, _VALUES):
        raise TypeError(f"{type(argument).__name__} may change")
    return type(argument), argument
