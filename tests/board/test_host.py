"""Where computations really run, which are late, and which need not be made again."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from kernels_for_tests import Counting, read_only
from small_board import Tickets, small_board, small_profile, start

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.host import Host, Limit, Overruns, ThreadedHost
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

LIMIT_S = 30
MS = 1_000_000
LIMIT = Limit("task", 30_000_000_000)
CLOCKS = pytest.mark.parametrize("threads", [None, 1], ids=["virtual", "wall"])


@contextmanager
def threaded_host(threads: int = 2) -> Iterator[tuple[WallEnvironment, ThreadedHost]]:
    environment = WallEnvironment()
    host = ThreadedHost(environment, threads)
    host._expected_ns["short"] = 1
    yield environment, host
    host.close()


@contextmanager
def host_with(threads: int | None) -> Iterator[tuple[VirtualEnvironment, Host]]:
    if threads is None:
        environment = VirtualEnvironment()
        yield environment, Host(environment)
    else:
        with threaded_host(threads) as (environment, host):
            yield environment, host


def late_after(environment: VirtualEnvironment, host: Host, modelled_ns: int, future: Any) -> Steps:
    yield environment.timeout(modelled_ns)
    return (yield from host.late_result(future))


def run(environment: VirtualEnvironment, process: Steps) -> Any:
    return environment.run(until=start(environment, process))


def test_in_virtual_time_a_result_is_there_at_once_and_never_late() -> None:
    environment = VirtualEnvironment()
    host = Host(environment)
    assert run(environment, host.result(host.start("task", max, 3, 5))) == 5
    assert run(environment, late_after(environment, host, 100, host.start("task", max, 3, 7))) == 7
    assert environment.now == 100
    assert host.overruns == Overruns()


def test_in_wall_time_a_result_that_is_there_in_time_is_no_overrun() -> None:
    with threaded_host() as (environment, host):
        future = host.start("task", max, 3, 5)
        future.result()
        assert run(environment, late_after(environment, host, 1, future)) == 5
        assert host.overruns == Overruns()


def test_in_wall_time_a_result_later_than_modelled_is_an_overrun_of_the_time_it_was_late() -> None:
    with threaded_host() as (environment, host):
        may_end = threading.Event()
        future = host.start("task", may_end.wait, LIMIT_S)
        began_ns = environment.now
        # Modelled after 1 ms, there after 3 ms at the earliest.
        environment.call_later(3 * MS, may_end.set)
        assert run(environment, late_after(environment, host, 1 * MS, future)) is True
        assert host.overruns.count == 1
        assert host.overruns.total_ns == environment.now - began_ns - 1 * MS
        assert host.overruns.total_ns >= 2 * MS


def test_every_overrun_counts() -> None:
    with threaded_host() as (environment, host):
        for number in (1, 2):
            may_end = threading.Event()
            environment.call_later(1 * MS, may_end.set)
            run(environment, late_after(environment, host, 1, host.start(number, may_end.wait, LIMIT_S)))
            assert host.overruns.count == number


def test_without_a_modelled_time_nothing_is_an_overrun() -> None:
    with threaded_host() as (environment, host):
        may_end = threading.Event()
        environment.call_later(1 * MS, may_end.set)
        assert run(environment, host.result(host.start("task", may_end.wait, LIMIT_S))) is True
        assert host.overruns == Overruns()


@CLOCKS
def test_what_a_computation_raises_reaches_who_asks_for_its_result(threads: int | None) -> None:
    with host_with(threads) as (environment, host), pytest.raises(ZeroDivisionError):
        run(environment, host.result(host.start("task", divmod, 1, 0)))


def test_a_computation_that_fails_late_is_an_overrun_too() -> None:
    with threaded_host() as (environment, host):
        may_end = threading.Event()

        def fail() -> None:
            may_end.wait(LIMIT_S)
            raise ValueError("late")

        environment.call_later(1 * MS, may_end.set)
        with pytest.raises(ValueError, match="late"):
            run(environment, late_after(environment, host, 1, host.start("task", fail)))
        assert host.overruns.count == 1


def test_the_hosts_of_a_closed_board_start_nothing_more() -> None:
    board = small_board(small_profile(), environment=WallEnvironment(), threads=1)
    board.close()
    for host in (board.host, board.sending_host):
        with pytest.raises(RuntimeError, match="the pool of threads is closed"):
            host.start("task", max, 1, 2)


def test_two_computations_run_at_the_same_time_in_wall_time() -> None:
    with threaded_host() as (environment, host):
        both = threading.Barrier(2, timeout=LIMIT_S)
        futures = [host.start(number, both.wait) for number in (1, 2)]
        assert {run(environment, host.result(future)) for future in futures} == {0, 1}


def test_in_wall_time_a_task_that_has_proved_short_runs_in_the_thread_of_the_event_loop() -> None:
    with threaded_host() as (_, host):
        name = threading.current_thread
        assert host.start("task", name).result() is not threading.current_thread()
        host._expected_ns["task"] = 1000
        assert host.start("task", name).result() is threading.current_thread()
        host._expected_ns["task"] = 1_000_000
        assert host.start("task", name).result() is not threading.current_thread()


def test_in_virtual_time_it_runs_in_line() -> None:
    with host_with(None) as (environment, host):
        assert run(environment, host.run("task", threading.current_thread)) is threading.current_thread()


@pytest.mark.parametrize(("expected_ns", "in_line"), [(1000, True), (99_999, True), (100_000, False)])
def test_in_wall_time_what_is_over_soon_runs_in_line(expected_ns: int, in_line: bool) -> None:
    with threaded_host(1) as (environment, host):
        host._expected_ns["task"] = expected_ns
        thread = run(environment, host.run("task", threading.current_thread))
        assert (thread is threading.current_thread()) == in_line


def test_what_may_wait_for_others_never_runs_in_line() -> None:
    with threaded_host(1) as (environment, host):
        for _ in range(2):
            thread = run(environment, host.run(None, threading.current_thread))
            assert thread is not threading.current_thread()


def test_what_took_longer_in_line_is_expected_to() -> None:
    with threaded_host(1) as (environment, host):
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


def test_in_virtual_time_equal_inputs_are_computed_once_for_all_boards() -> None:
    kernel = Counting(np.sort)
    for _ in range(2):
        host = Host(VirtualEnvironment())
        assert host.compute(kernel, np.array([3, 1, 2], np.uint32)).tolist() == [1, 2, 3]
    assert kernel.calls == 1


def test_in_wall_time_what_may_change_is_computed_each_time() -> None:
    with threaded_host() as (_, host):
        kernel = Counting(np.sort)
        for _ in range(3):
            result = host.compute(kernel, np.array([2, 1]))
            assert (result.tolist(), result.flags.writeable) == ([1, 2], False)
        assert kernel.calls == 3


@pytest.mark.parametrize(("modelled", "calls"), [(True, 1), (False, 2)])
def test_in_wall_time_a_model_computes_what_nobody_can_change_once(modelled: bool, calls: int) -> None:
    host = ThreadedHost(WallEnvironment(), 1, modelled=modelled)
    kernel = Counting(np.sum)
    source = read_only([1, 2])
    assert [host.compute(kernel, source) for _ in range(2)] == [3, 3]
    assert kernel.calls == calls
    host.close()


def test_in_wall_time_what_a_message_brings_is_computed_each_time() -> None:
    host = ThreadedHost(WallEnvironment(), 1)
    kernel = Counting(np.sum)
    received = np.frombuffer(bytes([1, 2]), np.uint8)
    assert [host.compute(kernel, received) for _ in range(2)] == [3, 3]
    assert kernel.calls == 2
    host.close()


@pytest.mark.parametrize("in_hardware", [True, False], ids=["hardware", "software"])
def test_a_slow_host_shows_in_the_spans_of_the_callback(in_hardware: bool) -> None:
    environment = WallEnvironment()
    board = small_board(small_profile({"slow": (1 * MS, 1 * MS)}), 1, environment=environment, threads=1)
    executor = Executor(board, software_workers=1, hardware_workers=1)
    source = Tickets(board)
    may_end = threading.Event()

    def function(_: object, __: SoftwareContext) -> bool:
        return may_end.wait(LIMIT_S)

    def thread(thread: HardwareThread) -> Steps:
        yield from thread.compute(may_end.wait, LIMIT_S)
        yield from thread.mem_write(np.zeros(100, np.uint8))

    if in_hardware:
        executor.add_hw_callback("slow", [0], CallbackKind.SUB, source, thread)
    else:
        executor.add_sw_callback("slow", CallbackKind.SUB, source, function)
    executor.spin()
    environment.call_later(0, source.put, "ticket")
    environment.call_later(3 * MS, may_end.set)
    done = environment.event()
    source.on_answer = done.succeed
    environment.run(until=done)
    board.close()
    (timeline,) = source.timelines
    assert timeline.stages_ns["execution"] == 1 * MS
    # It began after at most 1000 ns, the time of a reconfiguration.
    assert timeline.stages_ns["overrun"] == board.host.overruns.total_ns >= 2 * MS - 1000
    assert board.host.overruns.count == 1
    assert timeline.stages_ns["memif"] == (100 if in_hardware else 0)
