"""A callback that never ends: it is failed, its worker, slot and core are free, and the board goes on."""

from __future__ import annotations

import threading
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest
from small_board import Tickets, small_board, small_profile

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.os_resources import Mailbox, Mutex
from reconros_zenoh.board.timing import Cycles
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.errors import CallbackError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

SUB = CallbackKind.SUB
PROFILE = small_profile({"a": (100, 100), "b": (100, 100)}, cores=1)


@pytest.fixture
def forever() -> Any:
    """Keeps whoever waits for it until the test is over."""
    event = threading.Event()
    yield event
    event.set()


def test_a_slot_that_waits_for_ever_is_freed(caplog: pytest.LogCaptureFixture) -> None:
    board = small_board(PROFILE, 1)
    mailbox, mutex = Mailbox(board.environment, 1), Mutex(board.environment)

    def waits(thread: HardwareThread) -> Steps:
        ticket = yield from thread.get_init_data()
        if ticket == 0:
            yield from thread.mutex_lock(mutex)
            yield from thread.mbox_get(mailbox)
        return "well"

    executor, source = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback("a", [0], SUB, source, waits, limit_ms=0.005)
    executor.spin()
    source.put_at(0, 1)
    board.environment.run(until=100_000)
    assert executor.failures == {"a": 1}
    assert source.answers == [(1, "well")]
    assert board.slots[0].busy.ns == 5000
    assert mutex.try_lock("somebody")
    assert mailbox.try_put(7)
    board.environment.run(until=200_000)
    assert mailbox.try_get() == 7  # nobody waits for it any more
    (record,) = caplog.records
    assert record.getMessage().startswith("callback a failed after reconfiguration 0.001 ms; ")
    assert record.exc_info is not None
    assert str(record.exc_info[1]) == "callback a did not end within its limit of 0.005 ms."


def endless(thread: HardwareThread) -> Steps:
    while True:
        yield from thread.compute_cycles(10)


def stubborn(thread: HardwareThread) -> Steps:
    while True:
        try:
            yield from thread.compute_cycles(10)
        except Exception:  # noqa: BLE001 - what is tested
            continue


def satisfied(thread: HardwareThread) -> Steps:
    try:
        yield from thread.compute_cycles(10_000)
    except Exception:  # noqa: BLE001 - what is tested
        return "well"


def departing(thread: HardwareThread) -> Steps:
    try:
        yield from thread.compute_cycles(10_000)
    except Exception:  # noqa: BLE001 - what is tested
        yield from thread.exit("well")


@pytest.mark.parametrize(
    ("callback", "busy_ns"), [(endless, 1000), (stubborn, 1010), (satisfied, 1000), (departing, 1000)]
)
def test_a_call_is_failed_at_its_limit_whatever_it_does_about_it(
    callback: Callable[[HardwareThread], Steps], busy_ns: int
) -> None:
    board = small_board(PROFILE, 1)
    executor, source = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback("a", [0], SUB, source, callback, timing=Cycles(0), limit_ms=0.001)
    executor.spin()
    source.put(1)
    board.environment.run(until=100_000)
    assert executor.failures == {"a": 1}
    assert not source.answers
    assert board.slots[0].busy.ns == busy_ns


def test_the_core_of_a_stopped_callback_is_free(caplog: pytest.LogCaptureFixture) -> None:
    board = small_board(PROFILE)
    executor, a, b = Executor(board, 2, 0), Tickets(board), Tickets(board)
    executor.add_sw_callback("a", SUB, a, lambda _, __: None, timing=Cycles(10**6), limit_ms=0.01)
    executor.add_sw_callback("b", SUB, b, lambda _, __: None)
    executor.spin()
    a.put(1)
    b.put_at(20_000)
    board.environment.run(until=10**7)
    assert executor.failures == {"a": 1}
    assert b.timelines[0].age_ns == 100


def test_the_limit_is_not_reached(caplog: pytest.LogCaptureFixture) -> None:
    def quick(thread: HardwareThread) -> Steps:
        return (yield from thread.compute(partial(int, 5)))

    board = small_board(PROFILE, 1)
    executor, a, b = Executor(board, 1, 1), Tickets(board), Tickets(board)
    executor.add_hw_callback("a", [0], SUB, a, quick, limit_ms=1000)
    executor.add_sw_callback("b", SUB, b, lambda ticket, _: 1 / ticket, limit_ms=1000)
    executor.spin()
    for ticket in (2, 0):
        b.put(ticket)
    a.put(1)
    board.environment.run(until=10**10)
    assert a.answers == [(1, 5)]
    assert b.answers == [(2, 0.5)]
    assert executor.failures == {"b": 1}
    assert "division by zero" in caplog.text


@pytest.mark.parametrize("hardware", [True, False])
@pytest.mark.parametrize("wall", [True, False])
def test_a_computation_that_never_ends(
    hardware: bool, wall: bool, forever: threading.Event, caplog: pytest.LogCaptureFixture
) -> None:
    def kernel(ticket: int) -> str:
        if ticket == 0:
            forever.wait()
        return "well"

    def software(ticket: int, _: SoftwareContext) -> str:
        return kernel(ticket)

    def in_slot(thread: HardwareThread) -> Steps:
        ticket = yield from thread.get_init_data()
        return (yield from thread.compute(kernel, ticket))

    environment = WallEnvironment() if wall else None
    board = small_board(PROFILE, 1, environment=environment, threads=1 if wall else None)
    executor, source = Executor(board, 1, 1), Tickets(board)
    if hardware:
        executor.add_hw_callback("a", [0], SUB, source, in_slot, limit_ms=20)
    else:
        executor.add_sw_callback("a", SUB, source, software, limit_ms=20)
    executor.spin()
    done = board.environment.event()
    source.on_answer = lambda: succeed_once(done)
    board.environment.post(source.put, 0)
    board.environment.post(source.put, 1)
    board.environment.run(until=done)
    assert source.answers == [(1, "well")]
    assert executor.failures == {"a": 1}
    assert "did not end within its limit of 20 ms" in caplog.text
    board.close()


def test_a_function_that_was_given_up_gets_no_mutex(
    forever: threading.Event, caplog: pytest.LogCaptureFixture
) -> None:
    board = small_board(PROFILE)
    mutex, ended = Mutex(board.environment), threading.Event()

    def late(_: object, context: SoftwareContext) -> None:
        forever.wait()
        try:
            context.mutex_trylock(mutex)
        except CallbackError:
            ended.set()

    executor, source = Executor(board, 1, 0), Tickets(board)
    executor.add_sw_callback("a", SUB, source, late, limit_ms=1)
    executor.spin()
    source.put(1)
    board.environment.run(until=10**9)
    assert executor.failures == {"a": 1}
    forever.set()
    assert ended.wait(10)
    assert mutex.try_lock("somebody")


@pytest.mark.parametrize("limit_ms", [0, -1, float("inf"), float("nan"), 1e30, "20"])
def test_a_limit_that_cannot_be(limit_ms: float) -> None:
    board = small_board(PROFILE)
    with pytest.raises(UsageError, match=r"limit_ms of callback 'a' is .*: write a time above 0"):
        Executor(board, 1, 0).add_sw_callback("a", SUB, Tickets(board), lambda _, __: 0, limit_ms=limit_ms)
