from __future__ import annotations

import ctypes
import subprocess
import sys
from typing import TYPE_CHECKING

from reconros_zenoh.clock.process import tune_memory

if TYPE_CHECKING:
    import pytest

# Counts the buffers that malloc has taken from the kernel one by one (`hblks` of mallinfo2).
COUNT_MAPPED = """
import ctypes
from reconros_zenoh.clock.process import tune_memory

class MallInfo(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in
        "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost".split()]

mallinfo = ctypes.CDLL(None).mallinfo2
mallinfo.restype = MallInfo
before = mallinfo().hblks
untuned = bytearray(6 << 20)
between = mallinfo().hblks
tune_memory()
tuned = bytearray(6 << 20)
print(between - before, mallinfo().hblks - between)
"""


def test_large_buffers_come_from_the_heap() -> None:
    done = subprocess.run(
        [sys.executable, "-c", COUNT_MAPPED], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == ["1", "0"]


def test_a_c_library_without_mallopt_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda _: object())
    tune_memory.__wrapped__()
