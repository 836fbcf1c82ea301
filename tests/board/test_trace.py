"""A trace: what each part of a board did when, to the nanosecond."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from octets import OCTETS, sized
from small_board import BITSTREAM_BYTES, Tickets, ignore, small_board, small_profile, start, types

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.trace import Slice, Trace
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareThread

RECONFIGURATION_NS = BITSTREAM_BYTES // 2


def compute(thread: HardwareThread) -> Steps:
    yield from thread.compute(int)


def slices(board: Board) -> list[Slice]:
    """What took any time."""
    assert board.trace is not None
    return [each for each in board.trace.slices() if each.end_ns > each.begin_ns]


def test_a_call_in_a_slot_stands_there_with_its_stages_and_its_bitstream_at_the_icap() -> None:
    board = small_board(small_profile({"a": (0, 500)}, dispatch_ns=7), 1, traced=True)
    executor, source = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback("a", [0], CallbackKind.SUB, source, compute)
    executor.spin()
    source.put_at(30, 5000)
    board.environment.run(until=10_000)
    begins = 37 + RECONFIGURATION_NS
    assert slices(board) == [
        Slice("RS0", "a", "dispatch", 30, 37),
        Slice("ICAP", "a", None, 37, begins),
        Slice("RS0", "a", "reconfiguration", 37, begins),
        Slice("RS0", "a", "execution", begins, begins + 500),
        Slice("RS0", "a", None, 30, begins + 500),
        Slice("RS0", "a", "dispatch", 5000, 5007),
        Slice("RS0", "a", "execution", 5007, 5507),
        Slice("RS0", "a", None, 5000, 5507),
    ]


def test_software_workers_have_a_track_each_and_messages_are_in_the_stack_on_their_way_in_and_out() -> None:
    board = small_board(small_profile({"a": (100, 0)}, dds_message_ns=10), traced=True)
    executor = Executor(board, 2, 0)
    word = types().message("std_msgs/msg/UInt32")
    writer = board.writer(board.context.node("n"), word, "/out")
    source = Tickets(board)
    executor.add_sw_callback(
        "a", CallbackKind.SUB, source, lambda _, context: context.publish(writer, word.cls(data=1))
    )
    source.put_at(20)
    executor.spin()
    start(board.environment, board.dds.receive(1, 0, Timeline(board.environment, 0)))
    board.environment.run(until=10_000)
    assert slices(board) == [
        Slice("DDS stack", "in", None, 0, 10),
        Slice("software 0", "a", "execution", 20, 120),
        Slice("software 0", "a", None, 20, 120),
        Slice("DDS stack", "out", None, 120, 130),
    ]
    assert board.trace is not None
    assert [track.name for track in board.trace.tracks] == ["software 0", "software 1", "ICAP", "DDS stack"]


def test_a_call_that_fails_ends_and_one_that_still_runs_lasts_until_now() -> None:
    board = small_board(small_profile({"bad": (0, 0), "long": (0, 5000)}), 2, traced=True, static=(0, 1))
    executor = Executor(board, 0, 2)

    def bad(_: HardwareThread) -> Steps:
        yield board.environment.timeout(40)
        raise ValueError

    for slot, (name, thread) in enumerate({"bad": bad, "long": compute}.items()):
        source = Tickets(board)
        executor.add_hw_callback(name, [slot], CallbackKind.SUB, source, thread)
        source.put_at(10)
    executor.spin()
    board.environment.run(until=1000)
    assert slices(board) == [Slice("RS0", "bad", None, 10, 50), Slice("RS1", "long", None, 10, 1000)]
    assert slices(board)[1:] == [Slice("RS1", "long", None, 10, 1000)], "to look is to change nothing"


def test_a_gateway_is_in_its_slot_while_it_works_and_not_while_its_request_stands() -> None:
    board = small_board(small_profile(cancel_ns=30), 1, traced=True)
    topic = board.hardware_topic("/a", OCTETS)
    board.add_gateway("bridge", "/a", "/a", OCTETS, 0)
    board.environment.run(until=100)
    start(board.environment, topic.publish("p", sized(100), 100, Timeline(board.environment, 100)))
    board.environment.run(until=1000)
    assert slices(board) == [Slice("RS0", "bridge", None, 100, 200), Slice("RS0", "bridge", None, 200, 230)]


def test_a_trace_counts_from_when_its_board_began() -> None:
    environment = VirtualEnvironment()
    environment.run(until=700)
    trace = Trace(environment)
    trace.icap.begin("a")
    environment.run(until=710)
    trace.icap.end()
    trace.icap.begin("b")
    environment.run(until=740)
    assert list(trace.slices()) == [Slice("ICAP", "a", None, 0, 10), Slice("ICAP", "b", None, 10, 40)]


@pytest.mark.parametrize("in_hardware", [False, True])
def test_without_a_trace_there_is_none(in_hardware: bool) -> None:
    board = small_board(small_profile({"a": (10, 10)}), 1)
    executor, source = Executor(board, 1, 1), Tickets(board)
    if in_hardware:
        executor.add_hw_callback("a", [0], CallbackKind.SUB, source, compute)
    else:
        executor.add_sw_callback("a", CallbackKind.SUB, source, ignore)
    executor.spin()
    source.put(1)
    board.environment.run(until=10_000)
    assert executor.calls["a"] == 1
    assert board.trace is None
    assert source.timelines[0].track is None


def test_what_is_oldest_is_forgotten_first() -> None:
    environment = VirtualEnvironment()
    trace = Trace(environment)
    worker = trace.add_software_worker()
    for number in range(200_003):
        worker.begin(str(number))
        worker.end()
    worker.begin("now")
    names = [each.name for each in trace.slices()]
    assert (len(names), names[0], names[-2:]) == (200_001, "3", ["200002", "now"])
