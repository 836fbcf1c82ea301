"""What a host runs for one who waits for it: in line, in the pool, or with a limit in a thread of its own."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest
from small_board import start

from reconros_zenoh.board.host import Host, Limit
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.clock.wall import WallEnvironment

if TYPE_CHECKING:
    from collections.abc import Iterator

    from small_board import Steps

LIMIT = Limit("task", 30_000_000_000)
CLOCKS = pytest.mark.parametrize("threads", [None, 1], ids=["virtual", "wall"])


@contextmanager
def host_with(threads: int | None) -> Iterator[tuple[VirtualEnvironment, Host]]:
    environment = VirtualEnvironment() if threads is None else WallEnvironment()
    host = Host(environment, threads)
    host._expected_ns["short"] = 1
    yield environment, host
    host.close()


def run(environment: VirtualEnvironment, process: Steps) -> Any:
    return environment.run(until=start(environment, process))


def test_in_virtual_time_it_runs_in_line() -> None:
    with host_with(None) as (environment, host):
        assert run(environment, host.run("task", threading.current_thread)) is threading.current_thread()


@pytest.mark.parametrize(("expected_ns", "in_line"), [(1000, True), (99_999, True), (100_000, False)])
def test_in_wall_time_what_is_over_soon_runs_in_line(expected_ns: int, in_line: bool) -> None:
    with host_with(1) as (environment, host):
        host._expected_ns["task"] = expected_ns
        thread = run(environment, host.run("task", threading.current_thread))
        assert (thread is threading.current_thread()) == in_line


def test_what_may_wait_for_others_never_runs_in_line() -> None:
    with host_with(1) as (environment, host):
        for _ in range(2):
            thread = run(environment, host.run(None, threading.current_thread))
            assert thread is not threading.current_thread()


def test_what_took_longer_in_line_is_expected_to() -> None:
    with host_with(1) as (environment, host):
        run(environment, host.run("short", threading.current_thread))
        assert host._expected_ns["short"] > 1


@CLOCKS
@pytest.mark.parametrize("limit", [None, LIMIT], ids=["no limit", "a limit"])
@pytest.mark.parametrize("task", ["task", "short"])
def test_what_it_returns_or_raises_reaches_the_caller(
    threads: int | None, limit: Limit | None, task: str
) -> None:
    with host_with(threads) as (environment, host):
        assert run(environment, host.run(task, divmod, 7, 2, limit=limit)) == (3, 1)
        with pytest.raises(ZeroDivisionError):
            run(environment, host.run(task, divmod, 1, 0, limit=limit))


@CLOCKS
def test_with_a_limit_even_what_is_short_has_a_thread_of_its_own(threads: int | None) -> None:
    with host_with(threads) as (environment, host):
        thread = run(environment, host.run("short", threading.current_thread, limit=LIMIT))
        assert thread.name == "limited computation"
