"""How much memory a process may lock."""

from __future__ import annotations

import ctypes
import mmap

# <sys/mman.h> of Linux
_MLOCK_ONFAULT = 1


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
