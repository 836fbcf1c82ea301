"""Runs the services of a deployment as local processes."""

from __future__ import annotations

import time
from collections import deque
from functools import partial
from graphlib import TopologicalSorter
from typing import TYPE_CHECKING, Self

from deploy.child import local_environment
from deploy.compose import StartCondition
from deploy.service_run import ServiceRun, ServiceState
from deploy.signals import EndingSignals
from reconros_zenoh.clock.alarm import Alarm
from reconros_zenoh.errors import ExperimentError, FileError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from collections.abc import Set as AbstractSet
    from pathlib import Path

    from deploy.compose import Deployment

# A signal does not always end a wait (one in some ten experiments in wall time slept on).
# Python serves it when the wait ends.
_LONGEST_WAIT_S = 1.0


class LocalRunner:
    """A context in which the services of a deployment run, each in its own session and with its own log file.

    Services start while `wait_until_ready` or `run_until` is at work, each as soon as its conditions hold.
    When one fails, these methods stop all others and raise ExperimentError. The end of the context stops what
    still runs, also when this process gets SIGINT, SIGTERM or SIGHUP, which come out of the methods as
    KeyboardInterrupt and SystemExit; when it is killed outright, the kernel kills the services (launch.py).
    The logs stay, as `<log_folder>/<service>.log`.

    `on_event(service, state)` is called at each change of state, in the thread of the runner. Thread rule:
    one thread, preferably the main one, which alone can catch signals.
    """

    def __init__(
        self,
        deployment: Deployment,
        log_folder: Path,
        environment: Mapping[str, str],
        *,
        on_event: Callable[[str, ServiceState], None] = lambda _service, _state: None,
        stop_limit_s: float = 10.0,
    ) -> None:
        self._deployment = deployment
        self._log_folder = log_folder
        self._stop_limit_ns = round(stop_limit_s * 10**9)
        # Whatever happens is a call, put here by a thread that waits for a child; a signal only rings.
        self._events: deque[Callable[[], None]] = deque()
        self._alarm = Alarm()
        self._signals = EndingSignals(wake=self._alarm.ring)
        own_environment = local_environment(environment)
        services = deployment.services
        order = TopologicalSorter({name: service.depends_on for name, service in services.items()})
        self._runs = {
            name: ServiceRun(
                services[name],
                log_folder / f"{name}.log",
                own_environment,
                self._put,
                partial(on_event, name),
            )
            for name in order.static_order()
        }
        self._may_end = {
            name
            for service in services.values()
            for name, condition in service.depends_on.items()
            if condition is StartCondition.COMPLETED
        }

    def __enter__(self) -> Self:
        """Empty the logs and take over the signals."""
        try:
            self._log_folder.mkdir(parents=True, exist_ok=True)
            for run in self._runs.values():
                run.log.write_bytes(b"")
        except OSError as error:
            raise FileError(
                self._log_folder, None, f"cannot hold the logs ({error}).", "Choose another folder."
            ) from None
        self._signals.install()
        return self

    def __exit__(self, *_exception: object) -> None:
        """Stop what still runs and give the signals back."""
        try:
            self.stop()
        finally:
            self._signals.restore()

    @property
    def states(self) -> dict[str, ServiceState]:
        """Where each service stands now; those that others depend on come first."""
        return {name: run.state for name, run in self._runs.items()}

    def wait_until_ready(self) -> None:
        """Return when every service has started and, if it has a healthcheck, is healthy.

        One that has ended with status 0 counts as ready.
        """
        self._drive(lambda: all(run.ready for run in self._runs.values()), may_end=set(self._runs))

    def run_until(self, services: AbstractSet[str]) -> None:
        """Return when all these services have ended with status 0.

        No other one may end before, except those of earlier calls and those that another service waits for by
        `service_completed_successfully`.
        """
        unknown = services - self._runs.keys()
        if unknown:
            raise UsageError(
                f"{self._deployment.path} has no service {', '.join(sorted(unknown))}. "
                f"It has {', '.join(self._runs)}."
            )
        self._may_end |= services
        self._drive(
            lambda: all(self._runs[name].state is ServiceState.ENDED for name in services),
            may_end=self._may_end,
        )

    def stop(self) -> None:
        """Stop all services; each one gets SIGTERM when those that depend on it are gone.

        One that is stopped (SIGSTOP) would not hear that, and keep others that take leave of it: before, all
        get SIGCONT. SIGKILL comes after the limit, or at once when a second signal shows that the user is in
        a hurry.
        """
        with self._signals.held():
            try:
                self._stop()
            except BaseException:  # out of `on_event`; even so nothing may be left behind
                for run in self._runs.values():
                    run.kill()
                raise

    def _drive(self, done: Callable[[], bool], *, may_end: AbstractSet[str]) -> None:
        with self._signals.held():
            failure = self._serve(done, may_end)
        if failure is not None:
            self.stop()
            raise ExperimentError(failure)

    def _serve(self, done: Callable[[], bool], may_end: AbstractSet[str]) -> str | None:
        """Start and watch services until done or signalled; return what failed, if anything did."""
        while not self._signals.pending:
            for run in self._runs.values():
                if run.state is ServiceState.WAITING and self._may_start(run):
                    run.start()
            failure = self._failure(may_end)
            if failure is not None or done():
                return failure
            self._wait()
        return None

    def _may_start(self, run: ServiceRun) -> bool:
        return all(self._runs[name].meets(condition) for name, condition in run.service.depends_on.items())

    def _failure(self, may_end: AbstractSet[str]) -> str | None:
        for name, run in self._runs.items():
            problem = run.problem(may_end=name in may_end)
            if problem is not None:
                return problem
            for other, condition in run.service.depends_on.items():
                needed = self._runs[other]
                # Once ended it never will.
                if needed.exit_status is not None and not needed.meets(condition):
                    return f"Service {name} cannot start: {other} has ended and was never {condition}."
        return None

    def _wait(self) -> None:
        """Wait for an event or for the next thing that is due, and deal with it."""
        now_ns = time.monotonic_ns()
        due_s = [(run.next_ns - now_ns) / 10**9 for run in self._runs.values() if run.next_ns is not None]
        self._alarm.wait(max(0, min([_LONGEST_WAIT_S, *due_s])))
        while self._events:
            self._events.popleft()()
        for run in self._runs.values():
            run.act(time.monotonic_ns())

    def _put(self, event: Callable[[], None]) -> None:
        self._events.append(event)
        self._alarm.ring()

    def _stop(self) -> None:
        for run in self._runs.values():
            run.resume()
        while True:
            living = [run for run in self._runs.values() if run.living]
            needed = {name for run in living for name in run.service.depends_on}
            impatient = self._signals.count > 1
            for name, run in self._runs.items():
                if impatient or name not in needed:
                    run.stop(self._stop_limit_ns)
                if impatient:
                    run.kill()
            if not living:
                return
            self._wait()
