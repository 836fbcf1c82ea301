"""The stages of callbacks that work for each other on one board: each its own part, and the parts add up."""

from __future__ import annotations

from statistics import fmean
from typing import TYPE_CHECKING, Any

import pytest
from small_board import desktop, small_board, small_profile, types

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.hmt import FifoPlan, HmtSource, HmtWriter
from reconros_zenoh.board.sources import SubscriptionSource, TimerSource
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.writers import MessageWriter

WORD = types().message("std_msgs/msg/UInt32")
SUB = CallbackKind.SUB
TOPICS = {"publish": 3000, "notify_hardware": 500, "notify_software": 400, "copy_in": 2, "copy_out": 1}
TIMES = {"first": (0, 7000), "second": (0, 11_000), "last": (13_000, 0), "sink": (17_000, 0)}


def mean_ages_ms(board: Board) -> dict[str, float]:
    """How old the messages of each topic were when they left the board."""
    return {writer.topic: fmean(writer.ages_ns) / 1e6 for writer in board.writers if writer.ages_ns}


def chain_board(slots: int) -> Board:
    """A board whose callbacks hear each other without the link."""
    profile = small_profile(
        TIMES,
        topics=TOPICS,
        cores=4,
        link_ns=50_000,
        dds_message_ns=1000,
        osif_ns=70,
        hmt_overhead_ns=90,
        cancel_ns=2000,
    )
    return small_board(profile, slots)


def relay(writer: MessageWriter) -> Any:
    def thread(hardware: Any) -> Steps:
        message = yield from hardware.get_init_data()
        yield from hardware.compute(int)
        yield from hardware.publish(writer, WORD.cls(data=message.data))

    return thread


def answer(writer: MessageWriter) -> Any:
    def function(message: Any, context: SoftwareContext) -> None:
        context.publish(writer, WORD.cls(data=message.data))

    return function


def time_of_round_trips(board: Board) -> float:
    """Return the mean time [ms] from the request on /in to the answer on /out, of three one by one."""
    node, environment = desktop(board).node("client"), board.environment
    publisher = node.publisher(WORD, "/in")
    times_ns: list[int] = []
    node.subscription(
        WORD, "/out", lambda received: times_ns.append(environment.now - int(received.message.data))
    )
    environment.run(until=1)
    for _ in range(3):
        publisher.publish(WORD.cls(data=environment.now))
        environment.run(until=environment.now + 1_000_000)
    assert len(times_ns) == 3
    return sum(times_ns) / 3e6


def test_the_columns_of_a_chain_add_up_to_the_round_trip() -> None:
    board = chain_board(2)
    node, executor = board.context.node("n"), Executor(board, 2, 2)
    stream = board.hardware_topic("/stream", WORD)
    source = SubscriptionSource(board, node, WORD, "/in")
    executor.add_hw_callback("first", [0], SUB, source, relay(HmtWriter(stream)))
    second = HmtSource(board, stream, FifoPlan())
    executor.add_hw_callback("second", [1], SUB, second, relay(board.writer(node, WORD, "/local")))
    last = SubscriptionSource(board, node, WORD, "/local")
    executor.add_sw_callback("last", SUB, last, answer(board.writer(node, WORD, "/out")))
    sink = SubscriptionSource(board, node, WORD, "/local")
    executor.add_sw_callback("sink", SUB, sink, lambda _, __: None)
    executor.spin()
    round_trip_ms = time_of_round_trips(board)
    columns = board.spans.mean_ms()
    assert columns.keys() == {"first", "second", "last", "sink"}
    own_ms = {name: column["execution"] for name, column in columns.items()}
    assert own_ms == {name: max(times) / 1e6 for name, times in TIMES.items()}
    assert ["transport" in columns[name] for name in TIMES] == [True, False, True, False]
    chain_ms = sum(sum(columns[name].values()) for name in ("first", "second", "last"))
    assert chain_ms == pytest.approx(round_trip_ms)
    assert mean_ages_ms(board) == {"/out": pytest.approx(round_trip_ms)}


@pytest.mark.parametrize("inwards", [True, False], ids=["to hardware", "to software"])
def test_a_gateway_has_a_column_of_its_own_on_the_way(inwards: bool) -> None:
    board = chain_board(3)
    node, executor = board.context.node("n"), Executor(board, 1, 2)
    hmt, smt = ("/stream", "/in") if inwards else ("/stream", "/out")
    stream = board.hardware_topic("/stream", WORD)
    if inwards:
        writer = board.writer(node, WORD, "/out")
        executor.add_hw_callback("first", [0], SUB, HmtSource(board, stream, FifoPlan()), relay(writer))
    else:
        source = SubscriptionSource(board, node, WORD, "/in")
        executor.add_hw_callback("first", [0], SUB, source, relay(HmtWriter(stream)))
    board.add_gateway("bridge", hmt, smt, WORD, 2)
    executor.spin()
    round_trip_ms = time_of_round_trips(board)
    columns = board.spans.mean_ms()
    assert columns.keys() == {"first", "/bridge"}
    assert sum(sum(column.values()) for column in columns.values()) == pytest.approx(round_trip_ms)
    assert mean_ages_ms(board) == {"/out": pytest.approx(round_trip_ms)}
    assert columns["/bridge"].keys() >= {"dds", "gateway", "hmt"}


def test_a_message_in_a_fifo_waits_in_the_queue_until_a_worker_takes_it() -> None:
    board = chain_board(1)
    executor, stream = Executor(board, 0, 1), board.hardware_topic("/stream", WORD)

    def first(hardware: Any) -> Steps:
        yield from hardware.publish(publisher, WORD.cls(data=0))
        yield from hardware.compute(int)  # 7 us, from when the message is on its way

    def second(hardware: Any) -> Steps:
        yield from hardware.get_init_data()

    publisher = HmtWriter(stream)
    executor.add_hw_callback("first", [0], CallbackKind.TMR, TimerSource(board, 1_000_000), first)
    executor.add_hw_callback("second", [0], SUB, HmtSource(board, stream, FifoPlan()), second)
    executor.spin()
    board.environment.run(until=1_500_000)
    column = board.spans.mean_ms()["second"]
    assert (column["hmt"], column["queue"]) == (0.00009, 0.00691)


def test_what_is_read_here_and_elsewhere_counts_once_when_it_has_left() -> None:
    board = chain_board(0)
    node, executor = board.context.node("n"), Executor(board, 2, 0)
    timer = TimerSource(board, 1_000_000)
    out = board.writer(node, WORD, "/out")
    executor.add_sw_callback(
        "last", CallbackKind.TMR, timer, lambda _, context: context.publish(out, WORD.cls(data=0))
    )
    sink = SubscriptionSource(board, node, WORD, "/out")
    executor.add_sw_callback("sink", SUB, sink, lambda _, __: None)
    executor.spin()
    board.environment.run(until=1_500_000)
    here = board.spans.mean_ms()["last"]
    assert "transport" not in here
    assert mean_ages_ms(board) == {}
    desktop(board).node("client").subscription(WORD, "/out", lambda _: None)
    board.environment.run(until=2_500_000)
    # Of the two messages one has left, over a link of 50 us.
    assert board.spans.mean_ms()["last"]["transport"] == 0.05 / 2
    assert board.spans.mean_ms()["last"]["execution"] == here["execution"] == 0.013
    assert board.spans.mean_ms()["sink"]["execution"] == 0.017


def test_a_callback_that_begins_to_publish_is_no_longer_counted_by_its_calls() -> None:
    board = small_board(small_profile({"last": (13_000, 0)}, link_ns=50_000))
    node, executor = board.context.node("n"), Executor(board, 1, 0)
    out = board.writer(node, WORD, "/out")
    calls: list[object] = []

    def sometimes(message: object, context: SoftwareContext) -> None:
        calls.append(message)
        if len(calls) > 2:
            context.publish(out, WORD.cls(data=0))

    executor.add_sw_callback("last", CallbackKind.TMR, TimerSource(board, 1_000_000), sometimes)
    executor.spin()
    board.environment.run(until=2_500_000)
    assert sum(board.spans.mean_ms()["last"].values()) == 0.013
    board.environment.run(until=3_500_000)
    assert sum(board.spans.mean_ms()["last"].values()) == 0.013 + 0.05
