"""Wall-clock time: the same event loop, held to the monotonic clock."""

from __future__ import annotations

import ctypes
import sys
import time
from collections import deque
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

import numpy as np

from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    from collections.abc import Callable

_SPIN_NS = 100_000
_PR_SET_TIMERSLACK = 29
_LAGS_KEPT = 1 << 16


@dataclass(frozen=True, slots=True)
class Lag:
    """How late the event loop was over its last events: percentiles of start minus due time [us]."""

    events: int
    p50_us: float
    p99_us: float
    max_us: float


class WallEnvironment(VirtualEnvironment):
    """A VirtualEnvironment in which no event happens before its time on the monotonic clock.

    `now` is the due time of the event being processed, so a late event does not delay what follows from it:
    the model does not drift, the loop catches up. Calls come in from any thread through `post`; everything
    else belongs to the thread that runs the loop. Between events the loop sleeps; the last tenth of a
    millisecond it spins, because a sleep ends about that much late.
    """

    def __init__(self) -> None:
        super().__init__(time.monotonic_ns())
        self._inbox: SimpleQueue[tuple[int, Callable[..., object], tuple[object, ...]]] = SimpleQueue()
        self._lags_ns: deque[int] = deque(maxlen=_LAGS_KEPT)

    def clock_ns(self) -> int:
        """Return the monotonic clock [ns]; callable from any thread."""
        return time.monotonic_ns()

    def post(self, function: Callable[..., object], *arguments: object) -> None:
        """Have `function(*arguments)` called by the event loop now; from any thread or signal handler."""
        self._inbox.put((time.monotonic_ns(), function, arguments))

    def step(self) -> None:
        """Wait until the next event is due, then process it."""
        inbox = self._inbox
        while True:
            while not inbox.empty():
                self._schedule_posted(*inbox.get())
            due = self.peek()
            early_ns = due - time.monotonic_ns()
            if early_ns <= 0:
                break
            if early_ns <= _SPIN_NS:
                time.sleep(0)  # lets other threads have the interpreter
                continue
            try:
                # Without an event ahead (due is infinite) only a posted call can end the wait.
                timeout_s = None if early_ns == float("inf") else (early_ns - _SPIN_NS) / 1e9
                self._schedule_posted(*inbox.get(timeout=timeout_s))
            except Empty:
                pass
        # Events of the same instant follow from its first one: one lag for all.
        if due > self._now:
            self._lags_ns.append(int(-early_ns))
        super().step()

    def lag(self) -> Lag:
        """Return how late the loop was over the last events that had a time of their own."""
        lags = np.array(self._lags_ns, dtype=np.int64)
        if not len(lags):
            return Lag(0, 0.0, 0.0, 0.0)
        p50, p99 = np.percentile(lags, (50, 99)) / 1e3
        return Lag(len(lags), float(p50), float(p99), float(lags.max()) / 1e3)

    def _schedule_posted(
        self, posted_ns: int, function: Callable[..., object], arguments: tuple[object, ...]
    ) -> None:
        self.call_later(max(0, posted_ns - self.now), function, *arguments)


def keep_time() -> None:
    """Make this process's threads wake up punctually; called once by a daemon before it starts any thread.

    Linux delays timers by up to 50 us to save wake-ups, and CPython hands the interpreter over every 5 ms
    only.
    """
    sys.setswitchinterval(0.0005)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
