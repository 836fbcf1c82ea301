"""Wall-clock time: the same event loop, held to the monotonic clock."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from reconros_zenoh.clock.alarm import Alarm
from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    from collections.abc import Callable

    import simpy

# How long before an event a sleep is to end, and the share of sleeps that may end after it.
_FIRST_LEAD_NS = 100_000
_LEAST_LEAD_NS = 20_000
_MOST_LEAD_NS = 500_000
_LEAD_STEP_NS = 5_000
_LATE_SLEEPS = 0.05
_TURN_NS = 1_000_000
# A signal that comes just as the sleep begins is served when it ends.
_NAP_NS = 1_000_000_000
_LAGS_KEPT = 1 << 16


@dataclass(frozen=True, slots=True)
class Lag:
    """How late the event loop was over its last events: percentiles of start minus due time [us]."""

    p50_us: float
    p99_us: float


class WallEnvironment(VirtualEnvironment):
    """A VirtualEnvironment in which no event happens before its time on the monotonic clock.

    `now` is the due time of what is being done, so a late event does not delay what follows from it: the
    model does not drift, the loop catches up. Calls come in from any thread through `post`.

    The loop belongs to whoever has the turn. The thread in `run` takes it when the next event is due: it
    sleeps until shortly before and spins the rest, because a sleep ends late. By how much on this host it
    learns, within 20 to 500 us, so that one sleep in twenty ends after its event. A thread that posts takes
    the turn itself when it is free and does what is due, for to wake another thread takes longer than most
    messages do. Before `run` and after it nobody has the turn: posted calls wait.
    """

    def __init__(self) -> None:
        super().__init__(time.monotonic_ns())
        self._inbox: deque[tuple[int, Callable[..., object], tuple[object, ...]]] = deque()
        self.has_real_time_priority = False
        """Whether the thread in `run` goes before those of normal priority, as it is when `run` begins."""
        self._turn = threading.Lock()
        self._turn.acquire()
        self._alarm = Alarm()
        self._asleep_until: float = -1
        self._lead_ns: float = _FIRST_LEAD_NS
        self._failure: BaseException | None = None
        self._lags_ns: deque[int] = deque(maxlen=_LAGS_KEPT)

    def clock_ns(self) -> int:
        """Return the monotonic clock [ns]; callable from any thread."""
        return time.monotonic_ns()

    def post(self, function: Callable[..., object], *arguments: object) -> None:
        """Have `function(*arguments)` called by the event loop now; from any thread or signal handler."""
        self._inbox.append((time.monotonic_ns(), function, arguments))
        # Once more after each turn: another thread may have posted while it could not take the turn.
        while self._inbox and self._turn.acquire(blocking=False):
            try:
                next_due = self._catch_up(time.monotonic_ns() + _TURN_NS)
            except BaseException as error:  # noqa: BLE001 - raised again by `run`
                self._failure = error
                next_due = -1
            finally:
                self._turn.release()
            if next_due < self._asleep_until:
                self._asleep_until = -1
                self._alarm.ring()
                return

    def run(self, until: simpy.Event) -> Any:  # type: ignore[override] # only until an event
        """Keep the loop going until the event has happened and return its value, or raise its error.

        What else is due in the same turn still happens.
        """
        if until.callbacks is not None:
            # It may happen in another thread's turn.
            until.callbacks.append(lambda _: self._alarm.ring())
        self.has_real_time_priority = _has_real_time_priority()
        self._turn.release()
        try:
            while not until.processed:
                with self._turn:
                    # A turn at a time: a loop that never catches up ends too.
                    next_due = self._catch_up(time.monotonic_ns() + _TURN_NS)
                if not until.processed:
                    self._sleep(next_due)
                if self._failure is not None:
                    raise self._failure
        finally:
            self._turn.acquire()
        if not until.ok:
            raise cast("BaseException", until.value)
        return until.value

    def lag(self) -> Lag:
        """Return how late the loop was over the last events that had a time of their own."""
        lags = np.array(self._lags_ns, dtype=np.int64)
        if not len(lags):
            return Lag(0.0, 0.0)
        p50, p99 = np.percentile(lags, (50, 99)) / 1e3
        return Lag(float(p50), float(p99))

    def forget_lag(self) -> None:
        """Let `lag` speak of later events only."""
        self._lags_ns.clear()

    def _catch_up(self, deadline_ns: int) -> float:
        """Do what is due, in the order of time, and return when the next event is; called with the turn.

        At the deadline it stops with work left, and returns a time that has passed.
        """
        while True:
            due = self.peek()
            if self._inbox and self._inbox[0][0] <= due:
                if time.monotonic_ns() > deadline_ns:
                    return self._inbox[0][0]
                posted_ns, function, arguments = self._inbox.popleft()
                self._now = max(self._now, posted_ns)
                function(*arguments)
                continue
            late_ns = time.monotonic_ns() - due
            if late_ns < 0 or due + late_ns > deadline_ns:
                return due
            # Events of the same instant follow from its first one: one lag for all.
            if due > self._now:
                self._lags_ns.append(int(late_ns))
            self.step()

    def _sleep(self, until_ns: float) -> None:
        """Return shortly before the time, or when there is something to do before it.

        The caller looks again and again until then: what it does at the time is then in the caches.
        """
        lead_ns = self._lead_ns
        while not self._inbox:
            if time.monotonic_ns() >= until_ns:
                return
            # Others who want the interpreter get it here, not in the wait below: that gives it up before it
            # looks at the clock, so if one of them takes the core as well, the sleep begins after its work.
            time.sleep(0)
            early_ns = until_ns - time.monotonic_ns()
            if early_ns <= lead_ns:
                return
            self._asleep_until = until_ns
            # A thread whose turn ended before the line above could not see how long we sleep.
            if self._failure is not None or self.peek() < until_ns:
                return
            nap_ns = early_ns - lead_ns
            if self._alarm.wait(min(nap_ns, _NAP_NS) / 1e9):
                return
            if nap_ns <= _NAP_NS:
                self._learn_lead(time.monotonic_ns() > until_ns)

    def _learn_lead(self, is_late: bool) -> None:
        """Adjust how long before an event a sleep is to end."""
        step_ns = _LEAD_STEP_NS * (is_late - _LATE_SLEEPS)
        self._lead_ns = min(max(self._lead_ns + step_ns, _LEAST_LEAD_NS), _MOST_LEAD_NS)


def _has_real_time_priority() -> bool:
    """Tell whether this thread goes before those of normal priority."""
    if sys.platform != "linux":
        return False
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK in {os.SCHED_FIFO, os.SCHED_RR}
