"""How a process of this project keeps its memory."""

from __future__ import annotations

import ctypes
import gc
import mmap
from functools import cache

# <malloc.h> of glibc
_M_TRIM_THRESHOLD = -1
_M_TOP_PAD = -2
_M_MMAP_THRESHOLD = -3

# <sys/mman.h> of Linux
_MLOCK_ONFAULT = 1

_MIB = 1024 * 1024
_OBJECTS_BETWEEN_COLLECTIONS = 50_000


@cache
def tune_memory() -> None:
    """Leave what was imported out of the search for garbage, and keep large buffers in this process.

    To be called when everything is imported; only the first call does something, for what is garbage by a
    later one would stay for ever. CPython's collector would go through all modules time and again.
    """
    gc.freeze()
    gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS)
    _tune_malloc()


def _tune_malloc() -> None:
    """Freed buffers of up to 32 MiB stay in this process, so that the next large message finds them mapped.

    glibc otherwise returns every buffer of a large message to the kernel, and each new one costs a page
    fault per 4 KiB. Without effect on a C library that has no `mallopt`. The padding is address space, not
    memory: an idle process grows by nothing, a busy one keeps its largest use.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # not glibc; CDLL(None) is a TypeError on Windows
        return
    mallopt(_M_MMAP_THRESHOLD, 32 * _MIB)
    mallopt(_M_TRIM_THRESHOLD, 1024 * _MIB)
    mallopt(_M_TOP_PAD, 64 * _MIB)


def can_lock(size: int) -> bool:
    """Whether this process may lock `size` bytes of memory, as far as Linux tells; nothing stays locked."""
    try:
        mlock2 = ctypes.CDLL(None).mlock2
        memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE)
    except (AttributeError, OSError):  # a C library without mlock2; less address space than that
        return False
    with memory:
        first = ctypes.c_char.from_buffer(memory)
        locked = bool(mlock2(ctypes.byref(first), ctypes.c_size_t(size), _MLOCK_ONFAULT) == 0)
        del first  # else the memory cannot be closed
    return locked
