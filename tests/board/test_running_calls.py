"""What the status says while calls run, and of the shares for which parts of the board were busy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import Tickets, desktop, small_board, small_profile, types

from reconros_zenoh.board.answers import StatusAnswer
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.hmt import FifoPlan, HmtSource, HmtWriter
from reconros_zenoh.board.os_resources import Condition, Mailbox, Mutex, Semaphore
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.sources import SubscriptionSource, TimerSource
from reconros_zenoh.board.status import status
from reconros_zenoh.errors import CallbackError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from small_board import Steps

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareThread

WORD = types().message("std_msgs/msg/UInt32")
MS = 1_000_000


def test_two_callbacks_of_one_slot_that_block_each_other_over_a_stream_say_so() -> None:
    board = small_board(small_profile({"count": (0, 0), "read": (0, 0)}, hmt_overhead_ns=10), 1)
    executor = Executor(board, 0, 1)
    stream = board.hardware_topic("/x", WORD)
    writer = HmtWriter(stream)

    def count(thread: HardwareThread) -> Steps:
        for number in range(4):
            yield from thread.publish(writer, WORD.cls(data=number))

    def read(thread: HardwareThread) -> Steps:
        yield from thread.get_init_data()

    executor.add_hw_callback("count", [0], CallbackKind.TMR, TimerSource(board, 100 * MS), count)
    executor.add_hw_callback("read", [0], CallbackKind.SUB, HmtSource(board, stream, FifoPlan()), read)
    executor.spin()
    board.environment.run(until=3000 * MS)
    told = status(board, executor)
    StatusAnswer.model_validate(told)
    assert told["elapsed_ms"] == 3000
    assert told["callbacks"]["count"]["running"] == [{"slot": 0, "since_ms": 100, "waits_for": "room in /x"}]
    assert (told["callbacks"]["read"]["running"], told["callbacks"]["read"]["calls"]) == ([], 0)
    # It is in its slot from the end of the reconfiguration on, which took 1000 ns.
    assert told["slots"][0]["busy_ms"] == 2900 - 0.001


def test_a_call_that_found_room_waits_for_nothing_any_more() -> None:
    board = small_board(small_profile({"count": (0, 500)}), 1)
    executor = Executor(board, 0, 1)
    stream = board.hardware_topic("/x", WORD)
    reader = HmtSource(board, stream, FifoPlan(depth=1))
    reader.open(lambda: None)
    source, writer = Tickets(board), HmtWriter(stream)

    def count(thread: HardwareThread) -> Steps:
        for number in range(2):
            yield from thread.publish(writer, WORD.cls(data=number))
        yield from thread.compute(int)

    executor.add_hw_callback("count", [0], CallbackKind.TMR, source, count)
    executor.spin()
    source.put("go")

    def running() -> list[Any]:
        told: Any = executor.statistics()["count"]["running"]
        return [call["waits_for"] for call in told]

    board.environment.run(until=2000)
    assert running() == ["room in /x"]
    reader.take()
    board.environment.run(until=2100)
    assert running() == [None]
    board.environment.run(until=3000)
    assert running() == []


@pytest.mark.parametrize(("wait", "until_ns"), [("a condition", 1500), ("a full stream", 2500)])
def test_a_call_that_goes_on_after_an_error_waits_for_nothing_any_more(wait: str, until_ns: int) -> None:
    board = small_board(small_profile({"a": (0, 5000)}), 1)
    executor, source = Executor(board, 0, 1), Tickets(board)
    condition = Condition(board.environment, Mutex(board.environment))
    stream = board.hardware_topic("/x", WORD)
    HmtSource(board, stream, FifoPlan(depth=1)).open(lambda: None)
    writer = HmtWriter(stream)

    def callback(thread: HardwareThread) -> Steps:
        try:
            while wait == "a full stream":
                yield from thread.publish(writer, WORD.cls(data=1))
            yield from thread.cond_wait(condition)
        except CallbackError:
            yield thread._environment.timeout(1000)

    executor.add_hw_callback("a", [0], CallbackKind.TMR, source, callback, limit_ms=0.001)
    executor.spin()
    source.put("go")
    # The bitstream takes 1000 ns, the limit ends after 1000 more.
    board.environment.run(until=until_ns)
    told: Any = executor.statistics()["a"]["running"]
    assert told == [{"slot": 0, "since_ms": 0, "waits_for": None}]


@pytest.mark.parametrize(
    ("call", "waits_for"),
    [
        (lambda thread, _: thread.mbox_get(Mailbox(environment_of(thread), 1)), "a word in a mailbox"),
        (lambda thread, _: thread.mbox_put(Mailbox(environment_of(thread), 0), 1), "room in a mailbox"),
        (lambda thread, mutex: thread.mutex_lock(mutex), "a mutex"),
        (lambda thread, _: thread.sem_wait(Semaphore(environment_of(thread), 0)), "a semaphore"),
    ],
)
def test_a_call_says_which_resource_it_waits_for(
    call: Callable[[HardwareThread, Mutex], Steps], waits_for: str
) -> None:
    board = small_board(small_profile({"a": (0, 0)}), 1)
    executor, source, mutex = Executor(board, 0, 1), Tickets(board), Mutex(board.environment)
    mutex.try_lock(board)
    executor.add_hw_callback("a", [0], CallbackKind.TMR, source, lambda thread: call(thread, mutex))
    executor.spin()
    source.put("go")
    board.environment.run(until=5000)
    told: Any = executor.statistics()["a"]["running"]
    assert told == [{"slot": 0, "since_ms": 0, "waits_for": waits_for}]


def environment_of(thread: HardwareThread) -> Any:
    return thread._environment


def test_in_software_the_calls_of_all_workers_are_told() -> None:
    board = small_board(small_profile({"a": (5000, 0)}))
    executor, source = Executor(board, 2, 0), Tickets(board)
    executor.add_sw_callback("a", CallbackKind.TMR, source, lambda _, __: None)
    executor.spin()
    board.environment.run(until=1000)
    source.put("go")
    board.environment.run(until=2000)
    told: Any = executor.statistics()["a"]["running"]
    assert told == [{"slot": None, "since_ms": 0.001, "waits_for": None}]


def busy_board(profile: Any = None) -> tuple[Board, Executor]:
    """A board whose callback reads 1000 bytes and computes, asked by the desktop once at 0."""
    board = small_board(
        profile
        or small_profile(
            {"a": (0, 4000)}, osif_ns=100, dds_message_ns=600, core_share=0.5, icap_offset_ns=50
        ),
        1,
    )
    source = SubscriptionSource(board, board.context.node("n"), WORD, "/in")
    executor = Executor(board, 0, 1)

    def thread(hardware: HardwareThread) -> Steps:
        yield from hardware.get_init_data()
        yield from hardware.mem_read(np.zeros(1000, np.uint8))
        yield from hardware.compute(int)

    executor.add_hw_callback("a", [0], CallbackKind.SUB, source, thread)
    executor.spin()
    desktop(board).node("client").publisher(WORD, "/in").publish(WORD.cls(data=1))
    return board, executor


@pytest.mark.parametrize(
    ("until_ns", "busy_ns"),
    [
        # The stack has the message for 600 ns with half a core, the ICAP writes for 1050 ns, the
        # delegate works for 100 ns, and the MEMIF moves 1000 bytes at 1 B/ns.
        (300, {"cores": 150, "icap": 0, "memif": 0, "stack": 300}),
        (1000, {"cores": 300, "icap": 400, "memif": 0, "stack": 600}),
        (2000, {"cores": 400, "icap": 1050, "memif": 250, "stack": 600}),
        (9000, {"cores": 400, "icap": 1050, "memif": 1000, "stack": 600}),
    ],
)
def test_the_shares_are_those_of_what_was_really_done_until_now(
    until_ns: int, busy_ns: dict[str, int]
) -> None:
    board, executor = busy_board()
    board.environment.run(until=until_ns)
    cores = 2
    assert status(board, executor)["use"] == pytest.approx(
        {part: ns / until_ns / (cores if part == "cores" else 1) for part, ns in busy_ns.items()}
    )


def test_where_nothing_is_modelled_or_has_passed_there_are_no_shares() -> None:
    board, executor = busy_board(read_profile("native"))
    board.environment.run(until=1000)
    assert status(board, executor)["use"] is None
    assert status(*busy_board())["use"] is None
