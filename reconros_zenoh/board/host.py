"""Where the computations of callbacks really run."""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar, cast

from reconros_zenoh.board.kernel_results import KernelResults, computed, is_constant
from reconros_zenoh.board.thread_pool import ThreadPool
from reconros_zenoh.errors import CallbackLimitError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Hashable

    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)
_RESULTS_KEPT = 512
_CONSTANTS_KEPT = 8
_RUNS_REMEMBERED = 32
_IN_LINE_NS = 100_000
"""About what it costs to hand a computation to another thread and its result back."""

_of_all_boards = KernelResults(_RESULTS_KEPT)


@dataclass(slots=True)
class Overruns:
    """How often, and for how long in total [ns], a result came later than the model had it ready."""

    count: int = 0
    total_ns: int = 0


@dataclass(frozen=True, slots=True)
class Limit:
    """The longest that one call of a callback may take."""

    callback: str
    ns: int

    def error(self) -> CallbackLimitError:
        """Return what a call raises that takes longer."""
        return CallbackLimitError(self.callback, self.ns)


class _Done(Generic[R_co]):
    """A computation that ran in line; a Future would cost more than most of those."""

    __slots__ = ("_error", "_result")

    def __init__(self, result: R_co | None, error: BaseException | None) -> None:
        self._result = result
        self._error = error

    def done(self) -> bool:
        return True

    def result(self) -> R_co:
        if self._error is not None:
            raise self._error
        return cast("R_co", self._result)


def _in_line(function: Callable[..., R], *arguments: object) -> _Done[R]:
    try:
        return _Done(function(*arguments), None)
    except Exception as error:  # noqa: BLE001 - handed to whoever asks for the result
        return _Done(None, error)


def _in_own_thread(function: Callable[..., R], *arguments: object) -> Future[R]:
    future: Future[R] = Future()

    def run() -> None:
        try:
            future.set_result(function(*arguments))
        except (Exception, SystemExit) as error:  # noqa: BLE001 - handed to whoever asks for the result
            future.set_exception(error)

    threading.Thread(target=run, name="limited computation", daemon=True).start()
    return future


class Host:
    """Runs the real computation while the model decides when its result is ready.

    This one is for virtual time: everything runs in line, and a pure kernel computes equal inputs once for
    all boards of the process.
    """

    def __init__(self, environment: VirtualEnvironment) -> None:
        self._environment = environment
        self.overruns = Overruns()

    def start(
        self,
        task: Hashable,  # noqa: ARG002 - in line it may take any time
        function: Callable[..., R],
        *arguments: object,
        limit: Limit | None = None,
    ) -> Future[R] | _Done[R]:
        """Start a computation and return its future; `task` names what tends to take equally long.

        It is remembered for ever, so it must not be a new one with each message. A task of None may take any
        time, because it waits for others: it never holds up the event loop in wall time.

        With a limit it has a thread of its own, which nobody waits for longer: in virtual time the limit is
        one of this host's time as well, and its error stands in for the result.
        """
        if limit is None:
            return _in_line(function, *arguments)
        future = _in_own_thread(function, *arguments)
        if not wait([future], limit.ns / 1e9).done:
            return _Done(None, limit.error())
        return future

    def run(
        self, task: Hashable, function: Callable[..., R], *arguments: object, limit: Limit | None = None
    ) -> Generator[Awaitable, object, R]:
        """Return what a computation returns once it is there; for the parameters see `start`."""
        if limit is None:
            return function(*arguments)
        return (yield from self.result(self.start(task, function, *arguments, limit=limit)))

    def result(self, future: Future[R] | _Done[R]) -> Generator[Awaitable, object, R]:
        """Return the result of a started computation once it is there; raises what it raised."""
        if isinstance(future, Future) and not future.done():
            ready = self._environment.event()
            future.add_done_callback(lambda _: self._environment.post(ready.succeed))
            yield ready
        return future.result()

    def late_result(self, future: Future[R] | _Done[R]) -> Generator[Awaitable, object, R]:
        """Return the result like `result`, whose time has come in the model: any wait is an overrun."""
        due_ns = self._environment.now
        on_time = future.done()
        try:
            return (yield from self.result(future))
        finally:
            if not on_time:
                self.overruns.count += 1
                self.overruns.total_ns += self._environment.now - due_ns

    def until(self, due_ns: int) -> Generator[Awaitable, object, None]:
        """Return when this time has come in the model; if it has passed, that is an overrun."""
        late_ns = self._environment.now - due_ns
        if late_ns < 0:
            yield self._environment.timeout(-late_ns)
        elif late_ns > 0:
            self.overruns.count += 1
            self.overruns.total_ns += late_ns

    def compute(self, kernel: Callable[..., R], *arguments: object) -> R:
        """Return `kernel(*arguments)` of a pure kernel; called in the thread of a started computation.

        Arrays that it returns are read-only: others may get the same ones.
        """
        return _of_all_boards.of(kernel, *arguments)

    def forget_overruns(self) -> None:
        """Count overruns from here on."""
        self.overruns = Overruns()

    def close(self) -> None:
        """Start no other computation, and wait for a while for those that run."""


class ThreadedHost(Host):
    """The host in wall time: what is known to be over soon runs in line, all else in a pool of threads.

    Of inputs only arrays that nobody can change are known to be equal: comparing takes time, too.
    """

    def __init__(self, environment: VirtualEnvironment, threads: int, *, modelled: bool = True) -> None:
        """`threads` is the size of the pool.

        Not `modelled`, every computation is real, and the event loop may be held up longer by one in line.
        """
        super().__init__(environment)
        # What is expected to take less runs in line: it holds up the event loop that long.
        self._in_line_ns = _IN_LINE_NS if modelled else 10 * _IN_LINE_NS
        self._pool = ThreadPool(threads, "computation")
        self._expected_ns: dict[Hashable, float] = {}
        self._of_constants = KernelResults(_CONSTANTS_KEPT) if modelled else None

    def start(
        self, task: Hashable, function: Callable[..., R], *arguments: object, limit: Limit | None = None
    ) -> Future[R] | _Done[R]:
        """Start a computation and return its future, see `Host.start`."""
        if limit is not None:
            return _in_own_thread(function, *arguments)
        if task is None:
            return self._pool.submit(function, *arguments)
        if self._is_short(task):
            return _in_line(self._timed, task, function, *arguments)
        return self._pool.submit(self._timed, task, function, *arguments)

    def run(
        self, task: Hashable, function: Callable[..., R], *arguments: object, limit: Limit | None = None
    ) -> Generator[Awaitable, object, R]:
        """Return what a computation returns once it is there; for the parameters see `start`."""
        if limit is None and self._is_short(task):
            return self._timed(task, function, *arguments)
        return (yield from self.result(self.start(task, function, *arguments, limit=limit)))

    def compute(self, kernel: Callable[..., R], *arguments: object) -> R:
        """Return `kernel(*arguments)` of a pure kernel, see `Host.compute`."""
        if self._of_constants is not None and all(map(is_constant, arguments)):
            return self._of_constants.of(kernel, *arguments)
        return computed(kernel, *arguments)

    def close(self) -> None:
        """Start no other computation, and wait for a while for those that run."""
        self._pool.close()

    def _is_short(self, task: Hashable) -> bool:
        """Tell whether a computation of this kind is over before a thread of the pool would begin with it."""
        return self._expected_ns.get(task, self._in_line_ns) < self._in_line_ns

    def _timed(self, task: Hashable, function: Callable[..., R], *arguments: object) -> R:
        started_ns = time.perf_counter_ns()
        try:
            return function(*arguments)
        finally:
            took_ns = time.perf_counter_ns() - started_ns
            expected_ns = self._expected_ns.get(task, took_ns)
            # In the pool it may have waited for the interpreter or a core: the shortest times tell more.
            slower_ns = (took_ns - expected_ns) / _RUNS_REMEMBERED
            self._expected_ns[task] = min(took_ns, expected_ns + slower_ns)


def measured(function: Callable[..., R], *arguments: object) -> tuple[R, int]:
    """Return `function(*arguments)` and how long it took here [ns]."""
    started_ns = time.perf_counter_ns()
    return function(*arguments), time.perf_counter_ns() - started_ns
