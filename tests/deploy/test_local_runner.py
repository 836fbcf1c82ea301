"""The local runner with real processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import psutil
import pytest

from deploy.child import local_command
from deploy.compose import ComposeService, Healthcheck
from deploy.runner import LocalRunner
from deploy.service_run import ServiceState
from deploy.signals import EndingSignals
from reconros_zenoh.errors import ExperimentError, FileError, UsageError

if TYPE_CHECKING:
    from conftest import Services

NEVER_S = 10**6


class Recorder:
    """A runner whose events are kept."""

    def __init__(self, services: Services, *members: ComposeService, stop_limit_s: float = NEVER_S) -> None:
        self.events: list[tuple[str, str]] = []
        self.logs = services.folder / "logs"
        self.runner = LocalRunner(
            services.deployment(*members),
            self.logs,
            os.environ,
            on_event=lambda name, state: self.events.append((name, str(state))),
            stop_limit_s=stop_limit_s,
        )


def test_start_order_follows_health(services: Services) -> None:
    record = Recorder(
        services,
        services.service("late", "block()", early="healthy"),
        services.service("early", "write('ready'); block()", services.when_written("ready")),
    )
    with record.runner as runner:
        runner.wait_until_ready()
        assert runner.states == {"early": ServiceState.HEALTHY, "late": ServiceState.STARTED}
    assert record.events == [
        ("early", "started"),
        ("early", "healthy"),
        ("late", "started"),
        ("late", "stopped"),
        ("early", "stopped"),
    ]
    services.assert_gone()


def test_a_service_waits_for_the_good_end_of_another(services: Services) -> None:
    record = Recorder(
        services,
        services.service("job", "write('made')"),
        services.service("user", "assert (folder / 'made').exists()", job="completed_successfully"),
        services.service("server", "block()"),
    )
    with record.runner as runner:
        runner.run_until({"user"})
    assert [event for event in record.events if event[0] != "server"] == [
        ("job", "started"),
        ("job", "ended"),
        ("user", "started"),
        ("user", "ended"),
    ]


def test_independent_services_run_at_once(services: Services) -> None:
    os.mkfifo(services.folder / "pipe")
    # Opening a named pipe blocks until the other end is opened too.
    record = Recorder(
        services,
        services.service("reader", "(folder / 'pipe').open('rb').read()"),
        services.service("writer", "(folder / 'pipe').open('wb').write(b'x')"),
    )
    with record.runner as runner:
        runner.run_until({"reader", "writer"})
        assert set(runner.states.values()) == {ServiceState.ENDED}


def test_run_until_leaves_the_others_running(services: Services) -> None:
    record = Recorder(
        services,
        services.service("server", "write('ready'); block()", services.when_written("ready")),
        services.service("first", "", server="healthy"),
        services.service("second", "", first="completed_successfully"),
    )
    with record.runner as runner:
        runner.run_until({"first"})
        runner.run_until({"second"})
        assert runner.states["server"] is ServiceState.HEALTHY
    assert runner.states["server"] is ServiceState.STOPPED


def _failure(
    services: Services, *members: ComposeService, until: set[str] | None = None
) -> tuple[str, Recorder]:
    """Run the services until one fails; check that none is left and return the message."""
    record = Recorder(services, *members)
    with record.runner as runner, pytest.raises(ExperimentError) as caught:
        runner.wait_until_ready() if until is None else runner.run_until(until)
    services.assert_gone()
    return str(caught.value), record


def test_a_service_that_dies_ends_all(services: Services) -> None:
    grandchild = "subprocess.Popen([sys.executable, '-c', 'import signal; signal.pause()']).pid"
    message, record = _failure(
        services,
        services.service(
            "server",
            f"write('grandchild.pid', str({grandchild})); write('ready'); block()",
            services.when_written("ready"),
        ),
        services.service("bad", "[print('line', i) for i in range(50)]; sys.exit(3)", server="healthy"),
        services.service("after", "block()", bad="completed_successfully"),
        until={"after"},
    )
    lines = message.splitlines()
    assert lines[0] == "Service bad ended with status 3."
    assert str(record.logs / "bad.log") in lines[1]
    assert [line.strip() for line in lines[2:]] == [f"line {i}" for i in range(30, 50)]
    assert record.events[-3:] == [("bad", "failed"), ("after", "stopped"), ("server", "stopped")]


def test_the_signal_that_ended_a_service_is_named(services: Services) -> None:
    message, _ = _failure(
        services, services.service("victim", "os.kill(os.getpid(), signal.SIGKILL)"), until={"victim"}
    )
    assert message.startswith("Service victim was ended by SIGKILL.\nThe end of its log")
    assert message.endswith("nothing.")


def test_a_server_may_not_end_even_with_status_0(services: Services) -> None:
    message, _ = _failure(
        services, services.service("server", ""), services.service("client", "block()"), until={"client"}
    )
    assert message.startswith("Service server ended with status 0, but is needed")


def test_a_program_that_cannot_be_started(services: Services) -> None:
    record = Recorder(services, ComposeService("typo", ("no-such-program", "x")))
    with (
        pytest.raises(ExperimentError, match="typo ended with status 127") as caught,
        record.runner as runner,
    ):
        runner.run_until({"typo"})
    assert "no-such-program cannot be started: No such file" in str(caught.value)


def test_a_service_that_never_gets_healthy(services: Services) -> None:
    check = Healthcheck(("python", "-c", "print('not yet'); raise SystemExit(4)"), 10**6, retries=2)
    message, record = _failure(services, services.service("ill", "block()", check))
    lines = message.splitlines()
    assert lines[:2] == [
        "Service ill does not get healthy: its last healthcheck ended with status 4 and wrote:",
        "    not yet",
    ]
    assert record.events == [("ill", "started"), ("ill", "unhealthy"), ("ill", "stopped")]


def test_a_healthcheck_that_takes_too_long_fails(services: Services) -> None:
    blocking = services.service("check", "block()").command
    check = Healthcheck(blocking, interval_ns=10**6, timeout_ns=3 * 10**8, retries=1)
    message, _ = _failure(services, services.service("ill", "block()", check))
    assert "does not get healthy: its last healthcheck took too long" in message


def test_nobody_waits_for_the_health_of_a_service_that_has_ended(services: Services) -> None:
    never = Healthcheck(("false",), 10**6, retries=10**6)
    message, _ = _failure(
        services, services.service("gone", "", never), services.service("waiting", "", gone="healthy")
    )
    assert message == "Service waiting cannot start: gone has ended and was never service_healthy."


def test_the_end_of_the_context_kills_what_ignores_sigterm(services: Services) -> None:
    stubborn = "signal.signal(signal.SIGTERM, signal.SIG_IGN); print('here'); write('ready'); block()"
    record = Recorder(
        services, services.service("stubborn", stubborn, services.when_written("ready")), stop_limit_s=0.01
    )
    with record.runner as runner:
        runner.wait_until_ready()
    services.assert_gone()
    assert record.events[-1] == ("stubborn", "stopped")
    assert (record.logs / "stubborn.log").read_text() == "here\n"


def test_a_stopped_service_goes_on_so_that_it_and_who_needs_it_can_end(services: Services) -> None:
    os.mkfifo(services.folder / "answer")
    server = """
signal.signal(signal.SIGCONT, lambda *_: (folder / 'answer').write_text('bye'))
write('s')
block()
"""
    client = """
def end(*_):
    sys.exit((folder / 'answer').read_text() != 'bye')
signal.signal(signal.SIGTERM, end)
write('c')
block()
"""
    record = Recorder(
        services,
        services.service("server", server, services.when_written("s")),
        services.service("client", client, services.when_written("c"), server="healthy"),
    )
    with record.runner as runner:
        runner.wait_until_ready()
        os.kill(int((services.folder / "server.pid").read_text()), signal.SIGSTOP)
    services.assert_gone()
    assert record.events[-2:] == [("client", "stopped"), ("server", "stopped")]


def test_dependents_stop_first_and_get_the_time_to_do_so(services: Services) -> None:
    code = """
def end(*_):
    with (folder / 'order').open('a') as order: print(NAME, file=order)
    print('ended in peace')
    sys.exit(0)
signal.signal(signal.SIGTERM, end)
write(NAME + '.ready')
block()
"""
    record = Recorder(
        services,
        services.service("a", "NAME = 'a'" + code, services.when_written("a.ready")),
        services.service("b", "NAME = 'b'" + code, services.when_written("b.ready"), a="healthy"),
        services.service("c", "NAME = 'c'" + code, services.when_written("c.ready"), b="started"),
    )
    with record.runner as runner:
        runner.wait_until_ready()
    assert (services.folder / "order").read_text() == "c\nb\na\n"
    assert (record.logs / "a.log").read_text() == "ended in peace\n"


def test_an_exception_in_the_context_stops_all(services: Services) -> None:
    record = Recorder(services, services.service("server", "write('r'); block()", services.when_written("r")))

    def fail_within() -> None:
        with record.runner as runner:
            runner.wait_until_ready()
            raise KeyError

    with pytest.raises(KeyError):
        fail_within()
    services.assert_gone()


def test_an_exception_of_on_event_leaves_nothing_behind(services: Services) -> None:
    def fail(_service: str, state: ServiceState) -> None:
        if state is not ServiceState.STARTED:
            raise KeyError(state)

    server = services.service("server", "write('r'); block()", services.when_written("r"))
    runner = LocalRunner(services.deployment(server), services.folder, os.environ, on_event=fail)
    with pytest.raises(KeyError), runner:
        runner.wait_until_ready()
    services.assert_gone()


def test_a_stopped_deployment_does_not_start_again(services: Services) -> None:
    record = Recorder(services, services.service("server", "block()"))
    with record.runner as runner:
        runner.stop()
        with pytest.raises(ExperimentError, match="has been stopped"):
            runner.wait_until_ready()
    assert record.events == [("server", "stopped")]


def test_only_services_of_the_file_can_be_waited_for(services: Services) -> None:
    with (
        Recorder(services, services.service("a", "")).runner as runner,
        pytest.raises(UsageError, match="no service b"),
    ):
        runner.run_until({"a", "b"})


def test_logs_of_the_last_run_are_emptied_and_a_wrong_folder_is_told(services: Services) -> None:
    record = Recorder(services, services.service("a", "block()"))
    record.logs.mkdir()
    (record.logs / "a.log").write_text("old")
    with record.runner:
        assert (record.logs / "a.log").read_text() == ""
    wrong = LocalRunner(services.deployment(), services.folder / "logs" / "a.log", os.environ)
    with pytest.raises(FileError, match="cannot hold the logs"), wrong:
        pass


def test_services_see_their_environment(services: Services) -> None:
    show = services.service("show", "print(os.environ['GIVEN'], os.environ['BASE'], sys.executable)")
    show = replace(show, environment={"GIVEN": "own"})
    shell = ComposeService("shell", ("sh", "-c", "command -v python"))
    environment = {"GIVEN": "outer", "BASE": "base", "PATH": os.environ["PATH"]}
    logs = services.folder / "logs"
    with LocalRunner(services.deployment(show, shell), logs, environment) as runner:
        runner.run_until({"show", "shell"})
    assert (logs / "show.log").read_text() == f"own base {sys.executable}\n"
    assert (logs / "shell.log").read_text() == f"{Path(sys.executable).with_name('python')}\n"


def test_commands_of_the_virtual_environment() -> None:
    assert local_command(("reconros", "router")) == [sys.executable, "-m", "reconros_zenoh", "router"]
    assert local_command(("python3", "x.py")) == [sys.executable, "x.py"]
    assert local_command(("pythonic",)) == ["pythonic"]


def test_a_runner_works_in_another_thread(services: Services) -> None:
    record = Recorder(
        services,
        services.service("server", "write('r'); block()", services.when_written("r")),
        services.service("client", "", server="healthy"),
    )

    def run() -> None:
        with record.runner as runner:
            runner.run_until({"client"})

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert record.events[-2:] == [("client", "ended"), ("server", "stopped")]
    services.assert_gone()


def test_signals_are_given_back(services: Services) -> None:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    former = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        before = [signal.getsignal(number) for number in numbers]
        with Recorder(services, services.service("a", "")).runner:
            within = [signal.getsignal(number) for number in numbers]
        after = [signal.getsignal(number) for number in numbers]
    finally:
        signal.signal(signal.SIGHUP, former)
    assert after == before
    assert [here != there for here, there in zip(within, before, strict=True)] == [True, True, False]


RUNNER_PROGRAM = """
import os, pathlib, sys
from deploy.compose import read_compose
from deploy.runner import LocalRunner
folder = pathlib.Path(sys.argv[1])
def tell(service, state): print(service, state, flush=True)
deployment = read_compose(folder / 'compose.yaml', {})
with LocalRunner(deployment, folder / 'logs', os.environ, on_event=tell, stop_limit_s=1e6) as runner:
    runner.wait_until_ready()
    if 'outside' in sys.argv:
        print('outside', flush=True)
        sys.stdin.read()
    runner.run_until({'server'})
"""


def _runner_process(services: Services, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", RUNNER_PROGRAM, str(services.folder), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


def _read_until(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdout is not None
    assert any(got == f"{line}\n" for got in process.stdout)


STATUS = {
    signal.SIGTERM: 143,
    signal.SIGHUP: 129,
    signal.SIGINT: -signal.SIGINT,
    signal.SIGKILL: -signal.SIGKILL,
}


@pytest.mark.parametrize("number", STATUS, ids=lambda number: number.name)
@pytest.mark.parametrize("moment", ["server started", "server healthy", "outside"])
def test_a_signal_to_the_runner_stops_all(services: Services, number: signal.Signals, moment: str) -> None:
    services.compose_file(
        services.service("server", "write('ready'); block()", services.when_written("ready")),
        services.service("other", "block()", server="healthy"),
    )
    with _runner_process(services, moment) as process:
        _read_until(process, moment)
        children = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(number)
        _, errors = process.communicate()
        assert process.returncode == STATUS[number], errors
    assert children
    assert not psutil.wait_procs(children, timeout=30)[1]


def test_a_terminal_that_closes_is_in_no_hurry() -> None:
    signals = EndingSignals(wake=lambda: None)
    signals.install()
    try:
        with suppress(SystemExit), signals.held():
            for _ in range(3):  # the shell's, and that of the kernel when the shell has ended
                signal.raise_signal(signal.SIGHUP)
    finally:
        signals.restore()
    assert signals.count == 1


def test_a_second_signal_is_not_patient(services: Services) -> None:
    code = """
def refuse(*_): write('refused')
signal.signal(signal.SIGTERM, refuse)
write('ready')
block()
"""
    services.compose_file(
        services.service("server", code, services.when_written("ready")),
        # It stops first, which tells that the server is next.
        services.service("other", "block()", server="healthy"),
    )
    with _runner_process(services) as process:
        _read_until(process, "other started")
        process.send_signal(signal.SIGTERM)
        _read_until(process, "other stopped")
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate()
        assert process.returncode == STATUS[signal.SIGTERM], errors
    services.assert_gone()
