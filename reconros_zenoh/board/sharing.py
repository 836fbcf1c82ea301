"""A resource that its users share fairly while they overlap: processor cores, a memory interface."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator

    import simpy

    from reconros_zenoh.clock.virtual import VirtualEnvironment


class _Job:
    __slots__ = ("done", "first", "rate", "remaining")

    def __init__(self, work: float, done: simpy.Event, *, first: bool) -> None:
        self.remaining = work
        self.done = done
        self.first = first
        self.rate = 0.0


class SharedResource:
    """`capacity` units of work per nanosecond, of which one job gets at most `per_job`.

    Jobs marked `first` are served before all others; within each group the jobs that overlap get equal shares
    (processor sharing, the fluid limit of a time-sliced scheduler or of a round-robin bus arbiter).
    """

    def __init__(self, environment: VirtualEnvironment, capacity: float, per_job: float) -> None:
        self._environment = environment
        self._capacity = capacity
        self._per_job = per_job
        self._jobs: list[_Job] = []
        self._holds = 0
        self._since_ns = environment.now
        self._plan = 0

    def serve(self, work: float, *, first: bool = False) -> Generator[simpy.Event, object, None]:
        """Return when `work` units have been done for the caller; at once when there is none."""
        if work <= 0:
            return
        self._advance()
        job = _Job(work, self._environment.event(), first=first)
        self._jobs.append(job)
        self._share()
        yield job.done

    def hold_first(self) -> None:
        """Stop serving the jobs marked `first` until as many `release_first`; their work waits."""
        self._advance()
        self._holds += 1
        self._share()

    def release_first(self) -> None:
        """Take back one `hold_first`."""
        self._advance()
        self._holds -= 1
        self._share()

    def _advance(self) -> None:
        """Account for the work done since the shares last changed; whoever is through leaves."""
        elapsed_ns = self._environment.now - self._since_ns
        self._since_ns = self._environment.now
        if not elapsed_ns:
            return
        for job in self._jobs:
            job.remaining -= job.rate * elapsed_ns
        # Whole nanoseconds: what is left of the last one counts as done.
        finished = [job for job in self._jobs if job.remaining < job.rate]
        self._jobs = [job for job in self._jobs if job.remaining >= job.rate]
        for job in finished:
            job.done.succeed()

    def _share(self) -> None:
        """Give every job its rate and plan the next completion."""
        self._plan += 1
        left = self._capacity
        first = [job for job in self._jobs if job.first]
        for group in (first, [job for job in self._jobs if not job.first]):
            if not group:
                continue
            rate = min(self._per_job, left / len(group))
            if group is first and self._holds:
                rate = 0.0
            for job in group:
                job.rate = rate
            left -= rate * len(group)
        delays = [job.remaining / job.rate for job in self._jobs if job.rate > 0]
        if delays:
            self._environment.call_later(max(1, math.ceil(min(delays))), self._complete, self._plan)

    def _complete(self, plan: int) -> None:
        if plan == self._plan:  # else the shares have changed since
            self._advance()
            self._share()
