"""Where computations really run: overruns are counted, and what is known need not be computed again."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import Tickets, small_board, small_profile, start

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.host import Host, Overruns, computed
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

LIMIT_S = 30
MS = 1_000_000


class Counting:
    """A kernel that counts its calls."""

    def __init__(self, kernel: Callable[..., Any]) -> None:
        self.calls = 0
        self._kernel = kernel

    def __call__(self, *arguments: Any) -> Any:
        self.calls += 1
        return self._kernel(*arguments)


@contextmanager
def wall_host() -> Iterator[tuple[WallEnvironment, Host]]:
    environment = WallEnvironment()
    host = Host(environment, threads=2)
    yield environment, host
    host.close()


def late_after(environment: VirtualEnvironment, host: Host, modelled_ns: int, future: Any) -> Steps:
    yield environment.timeout(modelled_ns)
    return (yield from host.late_result(future))


def run(environment: VirtualEnvironment, process: Steps) -> Any:
    return environment.run(until=start(environment, process))


def test_in_virtual_time_a_result_is_there_at_once_and_never_late() -> None:
    environment = VirtualEnvironment()
    host = Host(environment, threads=None)
    assert run(environment, host.result(host.start("task", max, 3, 5))) == 5
    assert run(environment, late_after(environment, host, 100, host.start("task", max, 3, 7))) == 7
    assert environment.now == 100
    assert host.overruns == Overruns()


def test_in_wall_time_a_result_that_is_there_in_time_is_no_overrun() -> None:
    with wall_host() as (environment, host):
        future = host.start("task", max, 3, 5)
        future.result()
        assert run(environment, late_after(environment, host, 1, future)) == 5
        assert host.overruns == Overruns()


def test_in_wall_time_a_result_later_than_modelled_is_an_overrun_of_the_time_it_was_late() -> None:
    with wall_host() as (environment, host):
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
    with wall_host() as (environment, host):
        for number in (1, 2):
            may_end = threading.Event()
            environment.call_later(1 * MS, may_end.set)
            run(environment, late_after(environment, host, 1, host.start(number, may_end.wait, LIMIT_S)))
            assert host.overruns.count == number


def test_without_a_modelled_time_nothing_is_an_overrun() -> None:
    with wall_host() as (environment, host):
        may_end = threading.Event()
        environment.call_later(1 * MS, may_end.set)
        assert run(environment, host.result(host.start("task", may_end.wait, LIMIT_S))) is True
        assert host.overruns == Overruns()


@pytest.mark.parametrize("threads", [None, 1], ids=["virtual", "wall"])
def test_what_a_computation_raises_reaches_who_asks_for_its_result(threads: int | None) -> None:
    environment = VirtualEnvironment() if threads is None else WallEnvironment()
    host = Host(environment, threads)
    with pytest.raises(ZeroDivisionError):
        run(environment, host.result(host.start("task", divmod, 1, 0)))
    host.close()


def test_a_computation_that_fails_late_is_an_overrun_too() -> None:
    with wall_host() as (environment, host):
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
    with wall_host() as (environment, host):
        both = threading.Barrier(2, timeout=LIMIT_S)
        futures = [host.start(number, both.wait) for number in (1, 2)]
        assert {run(environment, host.result(future)) for future in futures} == {0, 1}


def test_in_wall_time_a_task_that_has_proved_short_runs_in_the_thread_of_the_event_loop() -> None:
    with wall_host() as (_, host):
        name = threading.current_thread
        assert host.start("task", name).result() is not threading.current_thread()
        host._expected_ns["task"] = 1000
        assert host.start("task", name).result() is threading.current_thread()
        host._expected_ns["task"] = 1_000_000
        assert host.start("task", name).result() is not threading.current_thread()


def test_in_virtual_time_equal_inputs_are_computed_once() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(np.sort)
    numbers = np.array([3, 1, 2], np.uint32)
    assert host.compute(kernel, numbers).tolist() == [1, 2, 3]
    assert host.compute(kernel, numbers.copy()).tolist() == [1, 2, 3]
    assert kernel.calls == 1


def test_in_wall_time_what_may_change_is_computed_each_time() -> None:
    with wall_host() as (_, host):
        kernel = Counting(np.sort)
        for _ in range(3):
            assert host.compute(kernel, np.array([2, 1])).tolist() == [1, 2]
        assert kernel.calls == 3


GRID = np.arange(6, dtype=np.uint32).reshape(2, 3)


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(GRID + 1, id="content"),
        pytest.param(GRID.reshape(3, 2), id="shape"),
        pytest.param(GRID.view(np.int32), id="type"),
        pytest.param(GRID.T, id="order"),
        pytest.param(np.empty((0, 3), np.uint32), id="empty"),
        pytest.param(7, id="number"),
    ],
)
def test_an_array_that_differs_is_computed_anew(other: Any) -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(np.shape)
    assert host.compute(kernel, GRID) == (2, 3)
    assert host.compute(kernel, other) == np.shape(other)
    assert kernel.calls == 2


def test_arrays_with_other_fields_are_different_arguments() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kind_of = attrgetter("dtype")  # one kernel
    for name, kind in (("x", np.uint32), ("y", np.uint32), ("y", np.float32)):
        assert host.compute(kind_of, GRID.view([(name, kind)])) == np.dtype([(name, kind)])


def test_equal_arrays_are_equal_however_they_lie_in_memory() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(np.sum)
    host.compute(kernel, GRID)
    host.compute(kernel, np.asfortranarray(GRID))
    host.compute(kernel, np.repeat(GRID, 2, axis=1)[:, ::2])
    assert kernel.calls == 1


def read_only(content: Any) -> Any:
    array = np.array(content)
    array.setflags(write=False)
    return array


def test_an_array_that_nobody_can_change_is_known_without_a_look_at_its_content() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(np.sum)
    source, other = read_only([1, 2]), read_only([1, 5])
    assert [host.compute(kernel, array) for array in (source, other, source, other)] == [3, 6, 3, 6]
    assert kernel.calls == 2


@pytest.mark.parametrize(("modelled", "calls"), [(True, 1), (False, 2)])
def test_in_wall_time_a_model_computes_what_nobody_can_change_once(modelled: bool, calls: int) -> None:
    host = Host(WallEnvironment(), threads=1, modelled=modelled)
    kernel = Counting(np.sum)
    source = read_only([1, 2])
    assert [host.compute(kernel, source) for _ in range(2)] == [3, 3]
    assert kernel.calls == calls
    host.close()


def test_of_what_a_kernel_returns_only_what_it_was_given_is_copied() -> None:
    made, given = np.zeros(3), np.zeros(3)
    results = computed(lambda _: (made, given), given)
    assert results[0] is made
    assert not np.shares_memory(results[1], given)
    assert [result.flags.writeable for result in results] == [False, False]
    assert given.flags.writeable


def test_in_wall_time_what_a_message_brings_is_computed_each_time() -> None:
    host = Host(WallEnvironment(), threads=1)
    kernel = Counting(np.sum)
    received = np.frombuffer(bytes([1, 2]), np.uint8)
    assert [host.compute(kernel, received) for _ in range(2)] == [3, 3]
    assert kernel.calls == 2
    host.close()


def test_a_read_only_view_of_an_array_that_changes_is_computed_anew() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(np.sum)
    array = np.array([1, 2])
    view = array.view()
    view.setflags(write=False)
    assert host.compute(kernel, view) == 3
    array[0] = 7
    assert host.compute(kernel, view) == 9


def the_same(array: Any) -> Any:
    return array


def a_part(array: Any) -> Any:
    return array[:1]


def doubled(array: Any) -> Any:
    return 2 * array, len(array)


@pytest.mark.parametrize("threads", [None, 1])
def test_a_result_stays_what_it_is_whatever_becomes_of_the_argument(threads: int | None) -> None:
    host = Host(VirtualEnvironment(), threads)
    for kernel in (the_same, a_part):
        array = np.array([1, 2])
        result = host.compute(kernel, array)
        array[0] = 7  # which is not read-only now
        assert result[0] == 1
        assert host.compute(kernel, np.array([1, 2]))[0] == 1
    host.close()


@pytest.mark.parametrize("threads", [None, 1])
def test_nobody_can_change_a_result_that_others_may_get(threads: int | None) -> None:
    host = Host(VirtualEnvironment(), threads)
    result, length = host.compute(doubled, np.array([1, 2]))
    with pytest.raises(ValueError, match="read-only"):
        result[0] = 7
    assert length == 2
    host.close()


def test_equal_numbers_of_different_types_are_different_arguments() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(type)
    numbers = [1, 1.0, True, np.uint8(1), np.int64(1)]
    assert [host.compute(kernel, number) for number in numbers * 2] == [
        type(number) for number in numbers
    ] * 2
    assert kernel.calls == 5


@pytest.mark.parametrize("number", [float, np.float32, np.float64])
def test_both_zeros_are_different_arguments(number: Callable[[float], Any]) -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(np.signbit)
    assert [host.compute(kernel, number(zero)) for zero in (0.0, -0.0) * 2] == [False, True] * 2
    assert kernel.calls == 2


@pytest.mark.parametrize("threads", [None, 1])
def test_what_has_no_hash_is_computed_each_time(threads: int | None) -> None:
    host = Host(VirtualEnvironment(), threads)
    kernel = Counting(len)
    numbers = [1, 2]
    assert host.compute(kernel, numbers) == 2
    numbers.append(3)
    assert host.compute(kernel, numbers) == 3
    assert kernel.calls == 2
    host.close()


def test_of_an_object_that_may_change_it_is_computed_each_time() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    counting = Counting(abs)  # it has a hash, that of its identity
    calls = attrgetter("calls")
    assert host.compute(calls, counting) == 0
    counting(7)
    assert host.compute(calls, counting) == 1


def test_what_a_kernel_raises_has_no_context_of_ours() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    with pytest.raises(ZeroDivisionError) as raised:
        host.compute(lambda numbers: numbers[0] / 0, [1])
    assert raised.value.__context__ is None


def test_two_kernels_do_not_share_results() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    assert host.compute(np.max, GRID) == 5
    assert host.compute(np.min, GRID) == 0


def test_only_the_results_used_last_are_kept() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(abs)
    for number in range(512):
        host.compute(kernel, number)
    host.compute(kernel, 0)  # used again: now 1 is the oldest
    host.compute(kernel, 512)
    assert kernel.calls == 513
    host.compute(kernel, 0)
    assert kernel.calls == 513
    host.compute(kernel, 1)
    assert kernel.calls == 514


def test_a_kernel_that_raises_is_tried_again() -> None:
    host = Host(VirtualEnvironment(), threads=None)
    kernel = Counting(lambda number: 1 / number)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            host.compute(kernel, 0)
    assert kernel.calls == 2


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
