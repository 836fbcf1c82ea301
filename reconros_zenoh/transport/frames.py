"""Shared memory that large payloads are written into."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from reconros_zenoh.transport.base import Parts

_MIB = 1024 * 1024
# From here on a frame beats the copy that Zenoh itself makes into shared memory. Round trip with a frame and
# without: 8 KiB 0.32 and 0.29 ms, 256 KiB 0.46 both, 900 KiB 0.9 and 1.0 ms, 6 MB 4.9 and 6.3 ms.
_SMALLEST_FRAME_BYTES = 256 * 1024
_FRAMES = 4
_LARGEST_POOL_BYTES = 64 * _MIB
_PIECE_BYTES = 512 * 1024


class Frame(Protocol):
    """A piece of shared memory; it takes bytes and bytearrays."""

    def __setitem__(self, place: slice, data: bytes | bytearray, /) -> None: ...


_Frame = TypeVar("_Frame", bound=Frame)


class Frames(Generic[_Frame]):
    """Joins payloads in pools of at least four of the largest frame so far; none is opened before the first.

    `open_pool` opens a pool of a number of bytes, or returns None when there is no shared memory. The pool
    returns a frame of a number of bytes, or None when none is free now; it never waits.
    """

    def __init__(self, open_pool: Callable[[int], Callable[[int], _Frame | None] | None]) -> None:
        self._open_pool = open_pool
        self._lock = Lock()
        self._pools: list[Callable[[int], _Frame | None]] = []
        self._pool_bytes = 0
        self._limit_bytes = _LARGEST_POOL_BYTES

    def join(self, parts: Parts) -> bytes | _Frame:
        """Return `parts` in one piece: in a frame when that is faster and there is one."""
        size = sum(map(len, parts))
        if size < _SMALLEST_FRAME_BYTES or (frame := self._allocate(size)) is None:
            return b"".join(parts)
        # From the last to the first: what a part brings of the bytes before it is then written over.
        end = size
        for part in reversed(parts):
            at = end - len(part)
            if not isinstance(part, memoryview):
                frame[at:end] = part
            elif (whole := _ending_with(part)) is not None and len(whole) <= end:
                frame[end - len(whole) : end] = whole
            else:
                # Piece by piece, the copy that a frame needs of a memoryview stays in the cache.
                for start in range(0, len(part), _PIECE_BYTES):
                    piece = bytes(part[start : start + _PIECE_BYTES])
                    frame[at + start : at + start + len(piece)] = piece
            end = at
        return frame

    def _allocate(self, size: int) -> _Frame | None:
        with self._lock:
            if size * _FRAMES > self._pool_bytes and not self._grow(size):
                return None
            return self._pools[-1](size)

    def _grow(self, size: int) -> bool:
        """Whether there is now a pool for frames of `size` bytes."""
        if size * _FRAMES > self._limit_bytes:
            return False
        pool_bytes = 1 << (size * _FRAMES - 1).bit_length()
        pool = self._open_pool(pool_bytes + _MIB)  # a pool keeps some for itself
        if pool is None:
            self._limit_bytes = size * _FRAMES - 1  # as much is not asked for again
            return False
        self._pools.append(pool)  # the last frames of the smaller ones may still be on their way
        self._pool_bytes = pool_bytes
        return True


def _ending_with(part: memoryview) -> bytes | None:
    """Return the bytes object at whose end the part lies, as an array of a received message does, if any."""
    owner: object = part
    while isinstance(owner, memoryview | np.ndarray):
        owner = owner.obj if isinstance(owner, memoryview) else owner.base
    if not (isinstance(owner, bytes) and part):
        return None
    return owner if np.may_share_memory(_last_byte(part), _last_byte(owner)) else None


def _last_byte(buffer: bytes | memoryview) -> NDArray[np.uint8]:
    return np.frombuffer(buffer, np.uint8, 1, len(buffer) - 1)
