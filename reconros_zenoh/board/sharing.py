"""A resource that its users share fairly while they overlap: processor cores, a memory interface."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from reconros_zenoh.clock.activity import Signal

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.clock.virtual import VirtualEnvironment


_ROUNDING_NS = 1e-9
"""Shares are rounded: a job whose exact end is a whole nanosecond must not be given the next one."""


class _Job(Signal):
    """Work that is being done; fires when it is done.

    `remaining` is what was left at `since_ns`; `due_ns` is when nothing will be, None while it waits. `limit`
    is the highest rate that it can use.
    """

    __slots__ = ("due_ns", "first", "limit", "rate", "remaining", "since_ns")

    def __init__(self, work: float, now_ns: int, limit: float, *, first: bool) -> None:
        super().__init__()
        self.remaining = work
        self.since_ns = now_ns
        self.limit = limit
        self.first = first
        self.rate = 0.0
        self.due_ns: int | None = None


def _limit(job: _Job) -> float:
    return job.limit


class SharedResource:
    """`capacity` units of work per nanosecond, of which one job gets at most `per_job`.

    Jobs marked `first` are served before all others; within each group the jobs that overlap get equal shares
    (processor sharing, the fluid limit of a time-sliced scheduler or of a round-robin bus arbiter). A job is
    done in the first whole nanosecond in which nothing is left of it.
    """

    def __init__(self, environment: VirtualEnvironment, capacity: float, per_job: float) -> None:
        self._environment = environment
        self._capacity = capacity
        self._per_job = min(per_job, capacity)
        self._jobs: list[_Job] = []
        self._asked = 0.0
        self._holds = 0
        self._contended = False  # else every job has all that it can use

    def serve(
        self, work: float, limit: float | None = None, *, first: bool = False
    ) -> Generator[Signal, object, None]:
        """Return when `work` units have been done for the caller; at once when there is none.

        `limit` is the most that the job can use at a time, if that is less than `per_job`.
        """
        if work <= 0:
            return
        self._asked += work
        job = _Job(work, self._environment.now, self._per_job if limit is None else limit, first=first)
        self._jobs.append(job)
        if self._contended or self._demand() > self._capacity:
            self._share()
        else:
            self._plan(job, job.limit)
        try:
            yield job
        except BaseException:  # the caller is stopped, or closed
            self._asked -= self._left(job)
            job.due_ns = None
            self._jobs.remove(job)
            self._share()
            raise

    def use(self, duration_ns: int) -> float:
        """Return the share of what could have been done in so long that has been done since the start."""
        done = self._asked - sum(map(self._left, self._jobs))
        return done / (self._capacity * duration_ns)

    @property
    def is_saturated(self) -> bool:
        """Whether a job marked `first` that comes now finds all of it in use, or itself held."""
        return self._holds > 0 or sum(job.limit for job in self._jobs if not job.first) >= self._capacity

    def hold_first(self) -> None:
        """Stop serving the jobs marked `first` until as many `release_first`; their work waits."""
        self._holds += 1
        self._share()

    def release_first(self) -> None:
        """Take back one `hold_first`."""
        self._holds -= 1
        self._share()

    def _left(self, job: _Job) -> float:
        return max(0.0, job.remaining - job.rate * (self._environment.now - job.since_ns))

    def _demand(self) -> float:
        demand = 0.0
        for job in self._jobs:
            demand += job.limit
        return demand

    def _share(self) -> None:
        """Give every job its rate, and a new completion where that changes."""
        self._contended = self._holds > 0 or self._demand() > self._capacity
        if not self._contended:
            for job in self._jobs:
                if job.rate != job.limit:
                    self._plan(job, job.limit)
            return
        left = self._capacity
        for group in ([job for job in self._jobs if job.first], [job for job in self._jobs if not job.first]):
            # Whoever can use less than an equal share leaves the rest to the others.
            for place, job in enumerate(sorted(group, key=_limit)):
                rate = min(job.limit, left / (len(group) - place))
                if job.first and self._holds:
                    rate = 0.0
                left -= rate
                if rate != job.rate:
                    self._plan(job, rate)

    def _plan(self, job: _Job, rate: float) -> None:
        now_ns = self._environment.now
        if job.due_ns == now_ns:
            return  # all of its work is done: it need not wait for anybody who comes in the same nanosecond
        job.remaining -= job.rate * (now_ns - job.since_ns)
        job.since_ns = now_ns
        job.rate = rate
        job.due_ns = None
        if rate > 0:
            delay_ns = max(0, math.ceil(job.remaining / rate - _ROUNDING_NS))
            job.due_ns = now_ns + delay_ns
            self._environment.call_later(delay_ns, self._complete, job)

    def _complete(self, job: _Job) -> None:
        if job.due_ns == self._environment.now:  # else its rate has changed since
            job.due_ns = None
            self._jobs.remove(job)
            if self._contended:
                self._share()
            job.fire()
