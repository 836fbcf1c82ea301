"""One service while it runs: its process, its health and its end."""

from __future__ import annotations

import signal
import tempfile
import time
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, BinaryIO

from deploy.child import Child
from deploy.compose import StartCondition
from deploy.health import Health
from deploy.logs import last_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from deploy.compose import ComposeService, Healthcheck

_TAIL_LINES = 20


class ServiceState(StrEnum):
    """Where a service stands."""

    WAITING = "waiting"  # for the services it depends on
    STARTED = "started"
    HEALTHY = "healthy"
    UNHEALTHY = "unhealthy"
    ENDED = "ended"  # by itself, with status 0
    FAILED = "failed"  # by itself with another status, or by a signal that is not the runner's
    STOPPED = "stopped"  # by the runner, or never started


@dataclass(slots=True)
class _Check:
    child: Child
    output: BinaryIO
    began_ns: int
    deadline_ns: int
    timed_out: bool = False


class ServiceRun:
    """A service from waiting to its end, moved on by the calls of the runner's loop.

    `post` hands a call from any thread to that loop, `on_state` is told each new state. Times are those of
    `time.monotonic_ns()`.
    """

    def __init__(
        self,
        service: ComposeService,
        log: Path,
        environment: Mapping[str, str],
        post: Callable[[Callable[[], None]], None],
        on_state: Callable[[ServiceState], None],
    ) -> None:
        self.service = service
        self.log = log
        self.state = ServiceState.WAITING
        self.exit_status: int | None = None
        self._environment = {**environment, **service.environment}
        self._post = post
        self._on_state = on_state
        self._child: Child | None = None
        self._health: Health | None = None
        self._check: _Check | None = None
        self._last_check = ""
        self._stopping = False
        self._kill_ns: int | None = None

    @property
    def living(self) -> bool:
        """Whether a process of this service is left."""
        return self._child is not None or self._check is not None

    @property
    def ready(self) -> bool:
        """Whether it has started and, if it has a healthcheck, is healthy, or has ended well."""
        if self.state is ServiceState.STARTED:
            return self.service.healthcheck is None
        return self.state in {ServiceState.HEALTHY, ServiceState.ENDED}

    @property
    def next_ns(self) -> int | None:
        """The time at which `act` has something to do, None when only an event can bring something."""
        if self._stopping:
            return self._kill_ns
        if self._health is None or self.state is not ServiceState.STARTED:
            return None
        if self._check is None:
            return self._health.next_check_ns
        return None if self._check.timed_out else self._check.deadline_ns

    def meets(self, condition: StartCondition) -> bool:
        """Whether a service that waits for this one under the condition may start."""
        match condition:
            case StartCondition.STARTED:
                return self.state is not ServiceState.WAITING
            case StartCondition.HEALTHY:
                return self._health is not None and self._health.healthy
            case StartCondition.COMPLETED:
                return self.state is ServiceState.ENDED

    def start(self) -> None:
        """Start the process; it was waiting before."""
        with self.log.open("ab") as log:
            self._child = self._start(self.service.command, log, self._exited)
        if self.service.healthcheck is not None:
            self._health = Health(self.service.healthcheck, time.monotonic_ns())
        self._set_state(ServiceState.STARTED)

    def act(self, now_ns: int) -> None:
        """Do what is due: begin a healthcheck, end one that takes too long, kill what does not stop."""
        if self.next_ns is None or now_ns < self.next_ns:
            return
        if self._stopping:
            self.kill()
        elif self._check is not None:
            self._check.timed_out = True
            self._check.child.send_signal(signal.SIGKILL)
        elif self.service.healthcheck is not None:
            self._begin_check(self.service.healthcheck, now_ns)

    def resume(self) -> None:
        """Let its process go on if it is stopped."""
        if self._child is not None:
            self._child.send_signal(signal.SIGCONT)

    def stop(self, limit_ns: int) -> None:
        """Send SIGTERM, and have `act` send SIGKILL after the limit; one that waits to start never will."""
        if self._stopping:
            return
        self._stopping = True
        if self._check is not None:
            self._check.child.send_signal(signal.SIGKILL)
        if self._child is not None:
            self._kill_ns = time.monotonic_ns() + limit_ns
            self._child.send_signal(signal.SIGTERM)
        elif self.state is ServiceState.WAITING:
            self._set_state(ServiceState.STOPPED)

    def kill(self) -> None:
        """Send SIGKILL to all of its processes."""
        self._stopping = True
        self._kill_ns = None
        if self._check is not None:
            self._check.child.send_signal(signal.SIGKILL)
        if self._child is not None:
            self._child.send_signal(signal.SIGKILL)

    def problem(self, *, may_end: bool) -> str | None:
        """Return why the deployment cannot go on with this service, and the end of its log, else None."""
        if self.state is ServiceState.UNHEALTHY:
            text = f"does not get healthy: its last healthcheck {self._last_check}"
        elif self.state is ServiceState.FAILED:
            text = f"{_ending(self.exit_status)}."
        elif self.state is ServiceState.ENDED and not may_end:
            text = f"{_ending(self.exit_status)}, but is needed until the others are done."
        elif self.state is ServiceState.STOPPED:
            text = "has been stopped."
        else:
            return None
        with self.log.open("rb") as log:
            lines = last_lines(log, _TAIL_LINES)
        return f"Service {self.service.name} {text}\n" + _quote(f"The end of its log ({self.log})", lines)

    def _start(self, command: tuple[str, ...], output: BinaryIO, then: Callable[[int], None]) -> Child:
        def on_exit(child: Child, status: int) -> None:
            self._post(partial(self._gone, child, status, then))

        return Child(command, self._environment, output, on_exit)

    def _gone(self, child: Child, status: int, then: Callable[[int], None]) -> None:
        child.send_signal(signal.SIGKILL)  # as in a container, nothing that a process has started outlives it
        then(status)

    def _exited(self, status: int) -> None:
        self._child = None
        self._kill_ns = None
        self.exit_status = status
        if self._check is not None:
            self._check.child.send_signal(signal.SIGKILL)
        if self._stopping:
            self._set_state(ServiceState.STOPPED)
        else:
            self._set_state(ServiceState.FAILED if status else ServiceState.ENDED)

    def _begin_check(self, healthcheck: Healthcheck, now_ns: int) -> None:
        output = tempfile.TemporaryFile()  # noqa: SIM115  # closed when the check has ended
        child = self._start(healthcheck.command, output, self._check_exited)
        self._check = _Check(child, output, now_ns, now_ns + healthcheck.timeout_ns)

    def _check_exited(self, status: int) -> None:
        check, self._check = self._check, None
        assert check is not None
        assert self._health is not None
        with check.output:
            lines = last_lines(check.output, _TAIL_LINES)
        if self._stopping or self.state is not ServiceState.STARTED:
            return
        ending = "took too long" if check.timed_out else _ending(status)
        self._last_check = _quote(f"{ending} and wrote", lines)
        self._health.record(
            passed=status == 0 and not check.timed_out,
            began_ns=check.began_ns,
            ended_ns=time.monotonic_ns(),
        )
        if self._health.healthy:
            self._set_state(ServiceState.HEALTHY)
        elif self._health.unhealthy:
            self._set_state(ServiceState.UNHEALTHY)

    def _set_state(self, state: ServiceState) -> None:
        self.state = state
        self._on_state(state)


def _ending(status: int | None) -> str:
    if status is not None and status < 0:
        return f"was ended by {signal.Signals(-status).name}"
    return f"ended with status {status}"


def _quote(title: str, lines: list[str]) -> str:
    if not lines:
        return f"{title}: nothing."
    return "\n".join([f"{title}:", *(f"    {line}" for line in lines)])
