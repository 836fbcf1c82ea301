"""The worker threads of an executor (ReconROS Executor, Section III-B, Fig. 4)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from types import GeneratorType
from typing import TYPE_CHECKING

from reconros_zenoh.board.callback import HardwareThread, ThreadExit
from reconros_zenoh.board.host import measured
from reconros_zenoh.board.software import SoftwareContext
from reconros_zenoh.board.timing import FixedTime
from reconros_zenoh.clock.activity import PARK, Activity, Signal, limited
from reconros_zenoh.errors import CallbackError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.executor.resource_mask import SOFTWARE

if TYPE_CHECKING:
    import random
    from collections.abc import Generator

    from reconros_zenoh.board.callback import HardwareCallback, HardwareImplementation
    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.host import Limit
    from reconros_zenoh.board.slots import Slot
    from reconros_zenoh.board.software import SoftwareImplementation
    from reconros_zenoh.board.sources import Event
    from reconros_zenoh.board.spans import Timeline
    from reconros_zenoh.board.trace import Track
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.executor.callbacks import Dispatch


class Worker(ABC):
    """One thread: takes a ready callback, runs it to completion, and looks again.

    A worker that finds nothing looks again once per poll period; it is woken when something became ready and
    goes on at the next point of that grid (`poll_ns` 0: at once), see `until_poll_ns`. `serves` is the
    timeline of the event whose callback it runs, since `since_ns`, or None.
    """

    def __init__(self, executor: Executor, resource: int, poll_ns: int, track: Track | None) -> None:
        self._executor = executor
        self._board = executor.board
        self._track = track
        self._environment = executor.board.environment
        self.resource = resource
        self._poll_ns = poll_ns
        model = executor.board.profile.model
        self._poll_jitter = model.executor.poll_jitter.share if model else 0.0
        self._dispatch_ns = model.executor.dispatch.ns if model else 0
        self.serves: Timeline | None = None
        self.since_ns = 0
        # Traced or not is known from the start: who is not traced pays nothing for it.
        self._call = self._traced if self._track else self._execute
        self.wake = Activity(self._run()).resume
        """Say that a callback which this worker may run has become ready."""

    def _run(self) -> Generator[Awaitable, object, None]:
        while True:
            dispatch = self._executor.select(self)
            if dispatch is None:
                dispatch = yield from self._wait()
            event: Event = dispatch.message  # type: ignore[assignment] # of its source
            self.serves, self.since_ns = event.timeline, self._environment.now
            event.timeline.callback = dispatch.entry.name
            try:
                response = yield from self._call(dispatch, event)
                self._executor.complete(dispatch, event, response)
            except (Exception, SystemExit) as error:  # noqa: BLE001 - a callback may raise or return anything
                self._executor.fail(dispatch, event, error)
            self.serves = None

    def _wait(self) -> Generator[Awaitable, object, Dispatch]:
        idle_since_ns = self._environment.now
        while True:
            yield PARK
            if self._poll_ns:
                idle_ns = self._environment.now - idle_since_ns
                delay_ns = until_poll_ns(self._poll_ns, idle_ns, self._poll_jitter, self._board.randomness)
                if delay_ns:
                    yield self._environment.timeout(delay_ns)
            dispatch = self._executor.select(self)
            if dispatch is not None:
                return dispatch

    def _within(
        self, limit: Limit | None, steps: Generator[Awaitable, object, object]
    ) -> Generator[Awaitable, object, object]:
        """Go through the steps of a callback, for as long as it may take."""
        if limit is None:
            return steps
        deadline = Signal()
        self._environment.call_later(limit.ns, deadline.fire)
        return limited(steps, deadline, limit.error)

    def _traced(self, dispatch: Dispatch, event: Event) -> Generator[Awaitable, object, object]:
        """Run the callback to completion, on the track of this worker."""
        track = self._track
        assert track is not None
        event.timeline.track = track
        track.begin(dispatch.entry.name)
        try:
            return (yield from self._execute(dispatch, event))
        finally:
            track.end()
            event.timeline.track = None

    @abstractmethod
    def _execute(self, dispatch: Dispatch, event: Event) -> Generator[Awaitable, object, object]:
        """Run the callback to completion and return what it returned."""


class SoftwareWorker(Worker):
    """Runs callbacks as functions on a core."""

    def __init__(self, executor: Executor, poll_ns: int) -> None:
        trace = executor.board.trace
        super().__init__(executor, SOFTWARE, poll_ns, trace.add_software_worker() if trace else None)

    def _execute(self, dispatch: Dispatch, event: Event) -> Generator[Awaitable, object, object]:
        board, timeline = self._board, event.timeline
        yield from board.cpu.run(self._dispatch_ns)
        timeline.mark("dispatch")
        implementation: SoftwareImplementation = dispatch.implementation  # type: ignore[assignment]
        context = SoftwareContext(board, dispatch.entry.name, implementation.time, event.sequence_number)
        try:
            response = yield from self._within(
                implementation.limit, self._run_function(dispatch.entry.name, implementation, event, context)
            )
        finally:
            context.release_mutexes()
        for send in context.sends:
            send(timeline.fork())
        return response

    def _run_function(
        self, name: str, implementation: SoftwareImplementation, event: Event, context: SoftwareContext
    ) -> Generator[Awaitable, object, object]:
        board, timeline, time = self._board, event.timeline, implementation.time
        function, limit, host = implementation.function, implementation.limit, self._board.host
        task = None if event.lasting else name
        if isinstance(time, FixedTime):
            future = host.start(task, function, event.message, context, limit=limit)
            yield from board.cpu.run(time.ns)
            timeline.mark("execution")
            response = yield from host.late_result(future)
            timeline.mark("overrun")
        elif time is None:
            response = yield from host.run(task, function, event.message, context, limit=limit)
            timeline.mark("execution")
        else:
            started_ns = self._environment.now
            response, took_ns = yield from host.run(
                task, measured, function, event.message, context, limit=limit
            )
            left_ns = round(took_ns * time.factor) - (self._environment.now - started_ns)
            yield from board.cpu.run(left_ns)
            timeline.mark("execution")
        return response


class HardwareWorker(Worker):
    """Runs callbacks in one slot."""

    def __init__(self, executor: Executor, slot: Slot, poll_ns: int) -> None:
        super().__init__(executor, slot.slot_id, poll_ns, slot.track)
        self._slot = slot

    def _execute(self, dispatch: Dispatch, event: Event) -> Generator[Awaitable, object, object]:
        board, timeline = self._board, event.timeline
        yield from board.cpu.run(self._dispatch_ns)
        timeline.mark("dispatch")
        implementation: HardwareImplementation = dispatch.implementation  # type: ignore[assignment]
        yield from board.zycap.write_bitstream(self._slot, implementation.bitstream)
        timeline.mark("reconfiguration")
        self._slot.busy.begin()
        thread = HardwareThread(board, dispatch.entry.name, self._slot, event, implementation)
        try:
            try:
                steps = _steps(implementation.callback, thread)
                response = yield from self._within(implementation.limit, steps)
            except ThreadExit as end:
                response = end.response
            except Exception as error:
                if not_begun := thread.not_begun():
                    error.add_note(not_begun)
                raise
            if not_begun := thread.not_begun():
                raise CallbackError(not_begun)
            if dispatch.entry.kind is CallbackKind.SRV:
                # Sending the response is a call through the delegate, as publishing is.
                yield from board.osif.call()
                timeline.mark("osif")
            return response
        finally:
            thread.close()
            self._slot.busy.end()


def until_poll_ns(poll_ns: int, idle_ns: int, jitter: float, randomness: random.Random) -> int:
    """Return how long [ns] until a worker that polls and has been idle for `idle_ns` looks next.

    Each period is as long as it happens to be: the point after k of them is off by sqrt(k) times the
    deviation of one, which is `jitter` of it.
    """
    drift_ns = poll_ns * jitter * math.sqrt(idle_ns / poll_ns)
    return round(-(idle_ns + randomness.gauss(0, drift_ns)) % poll_ns)


def _steps(callback: HardwareCallback, thread: HardwareThread) -> Generator[Awaitable, object, object]:
    steps = callback(thread)
    if not isinstance(steps, GeneratorType):
        raise TypeError(
            f"a hardware callback is a generator, this one returned {steps!r}. "
            "Call what takes time with `yield from`."
        )
    return steps
