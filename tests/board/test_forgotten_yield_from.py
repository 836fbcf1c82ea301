"""A call of a hardware callback without its `yield from`: it would do nothing, so it fails the callback."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import Tickets, small_board, small_profile, types

from reconros_zenoh.board.callback import HardwareThread
from reconros_zenoh.board.delegate_calls import DelegateCalls
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.os_resources import Mutex
from reconros_zenoh.board.timing import Cycles
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.errors import CallbackError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from small_board import Steps

WORDS = np.arange(4, dtype=np.uint32)


class Case:
    """A board whose slot runs the callback for each ticket; it computes for 50 ns, a call costs 7 ns."""

    def __init__(self, callback: Callable[[HardwareThread], Steps], **options: Any) -> None:
        self.board = small_board(small_profile({"a": (0, 50)}, osif_ns=7), 1)
        self.source = Tickets(self.board)
        self.executor = Executor(self.board, 0, 1)
        self.executor.add_hw_callback("a", [0], CallbackKind.SUB, self.source, callback, **options)
        self.executor.spin()

    def run(self, tickets: int = 1) -> None:
        for ticket in range(tickets):
            self.source.put(ticket)
        self.board.environment.run(until=100_000)


def failure(callback: Callable[[HardwareThread], Steps], caplog: pytest.LogCaptureFixture) -> BaseException:
    """What two calls of the callback have failed with, logged once."""
    case = Case(callback)
    case.run(2)
    assert case.executor.failures == {"a": 2}
    (record,) = caplog.records
    assert record.exc_info is not None
    assert record.exc_info[1] is not None
    return record.exc_info[1]


def line_of(callback: Callable[[HardwareThread], Steps], text: str) -> str:
    lines, first = inspect.getsourcelines(callback)
    number = next(number for number, line in enumerate(lines, first) if text in line)
    return f"{__file__}:{number}"


def test_a_forgotten_call_before_another(caplog: pytest.LogCaptureFixture) -> None:
    ran: list[int] = []

    def callback(thread: HardwareThread) -> Steps:
        yield from thread.get_init_data()
        thread.mem_write(WORDS)  # forgotten
        yield from thread.compute_cycles(10)
        ran.append(1)

    error = failure(callback, caplog)
    assert type(error) is CallbackError
    place = line_of(callback, "# forgotten")
    assert str(error) == f"mem_write() in {place} has done nothing. Write `yield from` before it."
    assert not ran


def test_a_forgotten_call_at_the_end(caplog: pytest.LogCaptureFixture) -> None:
    def callback(thread: HardwareThread) -> Steps:
        yield from thread.get_init_data()
        if True:
            thread.compute(np.sort, WORDS)  # forgotten

    assert f"compute() in {line_of(callback, '# forgotten')} has done" in str(failure(callback, caplog))


def test_a_forgotten_call_in_a_function_that_the_callback_calls(caplog: pytest.LogCaptureFixture) -> None:
    def helper(thread: HardwareThread) -> Steps:
        yield from thread.compute_cycles(1)
        thread.compute_cycles(2)  # forgotten

    def callback(thread: HardwareThread) -> Steps:
        yield from helper(thread)
        yield from thread.exit()

    assert f"compute_cycles() in {line_of(helper, '# forgotten')}" in str(failure(callback, caplog))


def test_a_call_whose_result_has_a_name(caplog: pytest.LogCaptureFixture) -> None:
    def callback(thread: HardwareThread) -> Steps:
        data = thread.mem_read(WORDS)  # forgotten
        yield from thread.compute_cycles(10)
        return data

    assert f"mem_read() in {line_of(callback, '# forgotten')}" in str(failure(callback, caplog))


def test_what_fails_for_want_of_a_result_says_so(caplog: pytest.LogCaptureFixture) -> None:
    def callback(thread: HardwareThread) -> Steps:
        data: Any = thread.mem_read(WORDS)  # forgotten
        yield from thread.compute(np.sort, data)

    error = failure(callback, caplog)
    assert not isinstance(error, CallbackError)
    (note,) = error.__notes__  # type: ignore[attr-defined] # it has one
    assert f"mem_read() in {line_of(callback, '# forgotten')}" in note


def test_a_forgotten_exit(caplog: pytest.LogCaptureFixture) -> None:
    def callback(thread: HardwareThread) -> Steps:
        yield from ()
        thread.exit()

    assert str(failure(callback, caplog)).startswith("exit() in ")


def test_no_message_leaves_and_no_mutex_is_held(caplog: pytest.LogCaptureFixture) -> None:
    def callback(thread: HardwareThread) -> Steps:
        yield from thread.mutex_lock(mutex)
        thread.publish(writer, writer.message(data=7))
        yield from thread.mutex_unlock(mutex)

    case = Case(callback)
    mutex = Mutex(case.board.environment)
    node = case.board.context.node("n")
    writer = TopicWriter(case.board, node, types().message("std_msgs/msg/UInt32"), "/out")
    case.run()
    assert case.executor.failures == {"a": 1}
    assert mutex.try_lock("somebody")
    assert case.board.slots[0].busy.ns == 7


@pytest.mark.parametrize("limit_ms", [None, 1000.0])
def test_calls_may_be_collected_and_gone_through_later(
    limit_ms: float | None, caplog: pytest.LogCaptureFixture
) -> None:
    def callback(thread: HardwareThread) -> Steps:
        first, second = thread.mem_read(WORDS), thread.mem_read(WORDS[:2])
        calls = [thread.compute_cycles(cycles) for cycles in range(20)]
        yield from thread.get_init_data()
        for call in reversed(calls):
            yield from call
        last = thread.exit("well")
        read = [(yield from second), (yield from first)]
        assert [len(words) for words in read] == [2, 4]
        yield from last

    case = Case(callback, limit_ms=limit_ms, timing=Cycles(0))
    case.run(2)
    assert not caplog.records
    assert case.source.answers == [(0, "well"), (1, "well")]


def test_a_collected_call_that_is_dropped(caplog: pytest.LogCaptureFixture) -> None:
    def callback(thread: HardwareThread) -> Steps:
        calls = [thread.compute_cycles(1), thread.mem_read(WORDS), thread.compute_cycles(3)]
        yield from calls[0]
        yield from calls[2]
        yield from thread.compute_cycles(1)

    assert str(failure(callback, caplog)).startswith("mem_read() in ")


def test_an_endless_callback_keeps_no_memory() -> None:
    def callback(thread: HardwareThread) -> Steps:
        kept.append(thread)
        following = thread.compute_cycles(1)
        while True:
            call, following = following, thread.compute_cycles(1)
            yield from call

    kept: list[HardwareThread] = []
    case = Case(callback, timing=Cycles(0))
    case.run()
    assert not case.executor.failures
    assert len(kept[0]._held) <= 2


def test_an_endless_callback_that_forgets(caplog: pytest.LogCaptureFixture) -> None:
    def callback(thread: HardwareThread) -> Steps:
        while True:
            yield from thread.compute_cycles(1)
            thread.mem_write(WORDS)

    case = Case(callback, timing=Cycles(0))
    case.run()
    assert case.executor.failures == {"a": 1}


def test_every_call_is_noted() -> None:
    calls = [
        call
        for cls in (HardwareThread, DelegateCalls)
        for name, call in vars(cls).items()
        if not name.startswith("_") and "Generator" in str(getattr(call, "__annotations__", {}).get("return"))
    ]
    assert calls
    assert {call.__code__.co_name for call in calls} == {"noting"}
