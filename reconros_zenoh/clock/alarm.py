"""Waking a thread that sleeps for a time."""

from __future__ import annotations

import threading
from contextlib import suppress


class Alarm:
    """Wakes the one thread that waits, or the next time that it does; rings that nobody heard are one.

    Deviation: not a SimpleQueue. In CPython 3.11 and 3.12 its `get` waits for ever when its time passes
    before it has begun to wait, as it does in a thread that just then loses its core.
    """

    def __init__(self) -> None:
        self._silence = threading.Lock()
        self._silence.acquire()

    def ring(self) -> None:
        """Wake it; from any thread or signal handler."""
        with suppress(RuntimeError):  # it rings already
            self._silence.release()

    def wait(self, timeout_s: float) -> bool:
        """Return True when it rings or has rung since the last wait, False after `timeout_s` (0 or more)."""
        return self._silence.acquire(timeout=timeout_s)
