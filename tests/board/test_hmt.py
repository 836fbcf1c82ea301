"""Hardware-mapped topics on a board of which a stream moves a byte per nanosecond."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgpack
import numpy as np
import pytest
from octets import HEADER, OCTETS, octets, size_of, sized
from small_board import Tickets, desktop, ignore, small_board, small_profile, start, transferred_bytes, types

from reconros_zenoh.board.board import Board
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.hmt import Fifo, FifoPlan, HmtSource, HmtWriter
from reconros_zenoh.board.kernel import Kernel
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.status import status
from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.gateway.filters import PublisherFilter
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from small_board import Steps


class Stream:
    """A hardware-mapped topic and what its subscribers saw, at which time."""

    def __init__(self, board: Board | None = None, **options: Any) -> None:
        self.board = board or small_board(small_profile(**options))
        self.environment = self.board.environment
        self.topic = self.board.hardware_topic("/a", OCTETS)
        self.seen: list[tuple[int, str]] = []

    def fifo(self, name: str, plan: FifoPlan | None = None, **options: Any) -> Fifo:
        own = options.pop("own", None)
        fifo = Fifo(
            plan or FifoPlan(depth=100),
            lambda: self.seen.append((self.environment.now, name)),
            own,
            cut_through=options.pop("cut_through", False),
        )
        self.topic.subscribe(fifo)
        return fifo

    def publish(self, body: Any, publisher: str = "p") -> Any:
        timeline = Timeline(self.environment, self.environment.now)
        return start(self.environment, self.topic.publish(publisher, body, size_of(body), timeline))


def test_a_message_takes_its_size_on_the_stream_and_its_overhead_at_each_subscriber() -> None:
    stream = Stream(hmt_overhead_ns=7)
    stream.fifo("a")
    stream.fifo("b")
    stream.environment.run(until=stream.publish(sized(100)))
    assert stream.environment.now == 100
    stream.environment.run()
    assert stream.seen == [(107, "a"), (107, "b")]


def test_one_message_passes_at_a_time_in_the_order_of_publication() -> None:
    stream = Stream()
    fifo = stream.fifo("a")
    first, second = sized(100), sized(50)
    stream.publish(first, "p")
    stream.publish(second, "q")
    stream.environment.run()
    assert stream.seen == [(100, "a"), (150, "a")]
    assert [fifo.take().message is body for body in (first, second)] == [True, True]


def test_a_reader_that_cuts_through_has_the_first_word_at_once() -> None:
    stream = Stream(hmt_overhead_ns=7)
    fifo = stream.fifo("a", cut_through=True)
    stream.publish(sized(100))
    assert stream.seen == [(0, "a")]
    complete = fifo.take().complete
    stream.environment.run()
    assert complete.callbacks is None


def test_a_full_fifo_that_blocks_holds_the_stream_up_until_there_is_room() -> None:
    stream = Stream()
    slow = stream.fifo("slow", FifoPlan(depth=1))
    stream.fifo("quick")
    stream.publish(sized(100))
    held_up = stream.publish(sized(100))
    stream.environment.call_later(1000, slow.take)
    stream.environment.run(until=held_up)
    assert stream.environment.now == 1100
    assert stream.seen == [(100, "slow"), (100, "quick"), (1100, "slow"), (1100, "quick")]
    assert (stream.topic.waits, stream.topic.dropped) == (1, 0)


def test_a_fifo_of_which_nothing_is_declared_blocks_the_third_message() -> None:
    stream = Stream()
    fifo = stream.fifo("a", FifoPlan())
    for _ in range(3):
        stream.publish(sized(100))
    stream.environment.run()
    assert stream.seen == [(100, "a"), (200, "a")]
    fifo.take()
    stream.environment.run()
    assert stream.seen[2:] == [(300, "a")]


def test_a_full_fifo_that_drops_holds_nobody_up() -> None:
    stream = Stream()
    slow = stream.fifo("slow", FifoPlan(1, "drop"))
    stream.fifo("quick")
    stream.publish(sized(100))
    stream.publish(sized(100))
    stream.environment.run()
    assert stream.seen == [(100, "slow"), (100, "quick"), (200, "quick")]
    assert (slow.dropped, stream.topic.dropped, stream.topic.waits) == (1, 1, 0)


def test_a_message_larger_than_a_fifo_is_refused_and_reaches_nobody() -> None:
    stream = Stream()
    stream.fifo("small", FifoPlan(message_bytes=99))
    stream.fifo("large")
    refused = stream.publish(sized(100))
    with pytest.raises(BadMessageError, match=r"100 bytes on hmt/board0/a does not fit a FIFO .* for 99"):
        stream.environment.run(until=refused)
    stream.publish(sized(99))
    stream.environment.run()
    assert [name for _, name in stream.seen] == ["small", "large"]


def test_a_subscriber_does_not_hear_the_publisher_that_its_filter_names() -> None:
    stream = Stream()
    stream.fifo("own", FifoPlan(depth=1), own=PublisherFilter("p"))
    stream.publish(sized(100), "p")
    stream.publish(sized(100), "p")
    stream.publish(sized(100), "q")
    stream.environment.run()
    assert stream.seen == [(300, "own")]


def test_nothing_is_in_the_network_but_through_the_tap_of_an_open_board() -> None:
    heard: list[tuple[bool, str, bytes]] = []
    for tap in (False, True):
        quiet = small_board(small_profile())
        board = Board(quiet.environment, quiet.context, quiet.profile, (), name="b", tap=tap)
        listener = desktop(board)
        listener.transport.subscribe(
            "**", lambda sample, tap=tap: heard.append((tap, sample.key, bytes(sample.payload))), QosProfile()
        )
        stream = Stream(board)
        stream.fifo("a")
        body = sized(20)
        stream.publish(body)
        board.environment.run()
        board.close()
        stream.publish(sized(30))
        board.environment.run()
    assert heard == [(True, "hmt/b/a", b"".join(OCTETS.encode(body)))]


def relay(writer: HmtWriter, log: list[Any]) -> Any:
    def thread(hardware: Any) -> Steps:
        received = yield from hardware.get_init_data()
        data = yield from hardware.mem_read(received.data)
        log.append(data)
        yield from hardware.mem_write(data, to=writer)
        yield from hardware.publish(writer, received)

    return thread


def test_a_kernel_between_two_streams_costs_no_memif() -> None:
    board = small_board(small_profile({"relay": (0, 0)}), slots=1)
    into, out = board.hardware_topic("/in", OCTETS), board.hardware_topic("/out", OCTETS)
    arrived = Fifo(FifoPlan(), lambda: None, None, cut_through=False)
    out.subscribe(arrived)
    executor, log = Executor(board, 0, 1), []
    executor.add_hw_callback(
        "relay", [0], CallbackKind.SUB, HmtSource(board, into, FifoPlan()), relay(HmtWriter(out), log)
    )
    executor.spin()
    body = octets(np.zeros(84))
    start(board.environment, into.publish("p", body, size_of(body), Timeline(board.environment, 0)))
    board.environment.run()
    assert log[0] is body.data
    streamed = arrived.take()
    # The first stream did not copy it, because the test published it; the second had to.
    assert streamed.message.data.tolist() == body.data.tolist()
    assert streamed.message.data is not body.data
    assert transferred_bytes(board) == 0
    # 100 ns on one stream, 1000 to load the slot, 100 on the other
    assert board.spans.mean_ms()["relay"] == pytest.approx(
        {"hmt": 0.0001, "queue": 0, "dispatch": 0, "reconfiguration": 0.001, "osif": 0}
    )
    assert board.environment.now == 1200


@pytest.mark.parametrize("writeable", [True, False])
def test_what_becomes_of_a_message_after_it_was_published_is_the_publishers_own_affair(
    writeable: bool,
) -> None:
    data = np.zeros(84, np.uint8)
    data.flags.writeable = writeable
    board = small_board(small_profile({"a": (0, 0)}), slots=1)
    topic = board.hardware_topic("/out", OCTETS)
    arrived = Fifo(FifoPlan(), lambda: None, None, cut_through=False)
    other = Fifo(FifoPlan(), lambda: None, None, cut_through=False)
    topic.subscribe(arrived)
    topic.subscribe(other)
    writer = HmtWriter(topic)

    def thread(hardware: Any) -> Steps:
        body = octets(data)
        if writeable:
            board.environment.call_later(50, data.fill, 1)  # while the bytes pass
        yield from hardware.publish(writer, body)
        body.data = np.full(84, 2, np.uint8)
        yield from hardware.publish(writer, body)

    executor, tickets = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback("a", [0], CallbackKind.SUB, tickets, thread)
    executor.spin()
    tickets.put(None)
    board.environment.run()
    assert executor.failures == {}
    assert data[0] == (1 if writeable else 0)
    messages = [arrived.take().message for _ in range(2)]
    assert [message.data[0] for message in messages] == [0, 2]
    # Nor can one subscriber change what another one gets.
    assert all(message is other.take().message for message in messages)
    assert not any(message.data.flags.writeable for message in messages)
    assert (messages[0].data is data) != writeable


def test_a_kernel_at_a_software_mapped_topic_pays_the_memif_for_the_same_lines() -> None:
    board = small_board(small_profile({"relay": (0, 0)}), slots=1)
    executor, tickets = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback(
        "relay",
        [0],
        CallbackKind.SUB,
        tickets,
        relay(HmtWriter(board.hardware_topic("/out", OCTETS)), []),
    )
    executor.spin()
    tickets.put(sized(100))
    board.environment.run()
    assert transferred_bytes(board) == 100 - HEADER


def test_a_bad_message_is_counted_logged_once_per_callback_and_its_place_is_free_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    board = small_board(small_profile({"left": (0, 0), "right": (0, 0)}), slots=2)
    topic = board.hardware_topic("/a", OCTETS)
    source = HmtSource(board, topic, FifoPlan(depth=1))

    def check(_: Any) -> None:
        raise BadMessageError("image_size", "too small")

    source.open(lambda: None, check)
    executor = Executor(board, 0, 2)
    tickets = [Tickets(board), Tickets(board)]
    for slot, name in enumerate(("left", "right")):
        callback = relay(HmtWriter(topic), [])
        executor.add_hw_callback(name, [slot], CallbackKind.SUB, tickets[slot], callback)
    executor.spin()
    for _ in range(3):
        for end in tickets:
            end.put(sized(20))
    board.environment.run()
    assert not source.is_ready()
    assert topic.passed == 6
    assert dict(board.context.rejections.counts()) == {"image_size": 6}
    assert sorted(text.split(" (")[0] for text in caplog.messages) == [
        "refused a message on hmt/board0/a from publisher left",
        "refused a message on hmt/board0/a from publisher right",
    ]


def test_no_end_of_a_stream_runs_in_software() -> None:
    board = small_board(small_profile({"a": (0, 0)}))
    topic = board.hardware_topic("/a", OCTETS)
    with pytest.raises(UsageError, match="'a' reads a hardware-mapped topic"):
        Executor(board, 1, 0).add_sw_callback(
            "a", CallbackKind.SUB, HmtSource(board, topic, FifoPlan()), ignore
        )
    with pytest.raises(UsageError, match="hmt/board0/a is mapped to hardware"):
        HmtWriter(topic).encode(sized(20))


def test_a_topic_has_one_type_and_a_profile_must_know_streams() -> None:
    board = small_board(small_profile())
    board.hardware_topic("/a", OCTETS)
    with pytest.raises(UsageError, match=r"hmt/board0/a has the type std_msgs/msg/UInt8MultiArray"):
        board.hardware_topic("/a", types().message("std_msgs/msg/UInt32"))
    with pytest.raises(UsageError, match=r"\[model.hmt\]"):
        small_board(read_profile("miniitx-zynq7100")).hardware_topic("/a", OCTETS)


def test_the_status_counts_what_passed() -> None:
    stream = Stream(small_board(small_profile()))
    stream.fifo("a", FifoPlan(1, "drop"))
    stream.publish(sized(20))
    stream.publish(sized(20))
    stream.environment.run()
    shown = msgpack.unpackb(msgpack.packb(status(stream.board, Executor(stream.board, 1, 0))))
    assert shown["hmt"] == {"hmt/board0/a": {"passed": 2, "dropped": 1, "waits": 0}}


def test_pointers_and_plain_kernels_work_on_a_stream_as_well() -> None:
    def walk(hardware: Any) -> Steps:
        pointer = yield from hardware.get_init_data()
        pointer = yield from hardware.mem_read(pointer + hardware.offsetof(OCTETS, "data.data"), 4)
        walked.append((yield from hardware.mem_read(pointer[0], 84, np.uint8)))

    def double(data: Any) -> Any:
        return 2 * data

    walked: list[Any] = []
    board = small_board(small_profile({"walk": (0, 0), "kernel": (0, 0)}), slots=2)
    into, out = board.hardware_topic("/in", OCTETS), board.hardware_topic("/out", OCTETS)
    arrived = Fifo(FifoPlan(), lambda: None, None, cut_through=False)
    out.subscribe(arrived)
    kernel = Kernel(double, ("data",), lambda _, data: octets(data), publish=HmtWriter(out))
    executor = Executor(board, 0, 2)
    for slot, (name, callback) in enumerate({"walk": walk, "kernel": kernel}.items()):
        source = HmtSource(board, into, FifoPlan())
        executor.add_hw_callback(name, [slot], CallbackKind.SUB, source, callback)
    executor.spin()
    body = octets(np.arange(84, dtype=np.uint8))
    start(board.environment, into.publish("p", body, size_of(body), Timeline(board.environment, 0)))
    board.environment.run()
    assert walked[0].tolist() == body.data.tolist()
    assert arrived.take().message.data.tolist() == (2 * body.data).tolist()
    assert transferred_bytes(board) == 0
    assert executor.failures == {}


def read_bytes(source: Any) -> int:
    """How much crosses the MEMIF when a callback reads this for a message that came over a stream."""

    def reader(hardware: Any) -> Steps:
        init = yield from hardware.get_init_data()
        yield from hardware.mem_read(*source(hardware, init))

    board = small_board(small_profile({"reader": (0, 0)}), slots=1)
    topic = board.hardware_topic("/in", OCTETS)
    executor = Executor(board, 0, 1)
    executor.add_hw_callback("reader", [0], CallbackKind.SUB, HmtSource(board, topic, FifoPlan()), reader)
    executor.spin()
    body = octets(WHOLE[:84])
    start(board.environment, topic.publish("p", body, size_of(body), Timeline(board.environment, 0)))
    board.environment.run()
    assert (executor.calls, executor.failures) == ({"reader": 1}, {})
    return transferred_bytes(board)


def block_of(hardware: Any, init: Any) -> int:
    """Where the bytes of `data` stand."""
    pointer = hardware._board.memory.read(init + hardware.offsetof(OCTETS, "data.data"), 4)
    return int(pointer.view(np.uint32)[0])


MESSAGE_READS = {
    "an array": lambda _, init: (init.data,),
    "a view of it": lambda _, init: (init.data[10:20:2].reshape(1, 5),),
    "all of it backwards": lambda _, init: (init.data[::-1],),
    "a field as an array": lambda _, init: (init.array("data"),),
    "a number as an array": lambda _, init: (init.array("layout.data_offset"),),
    "its struct": lambda _, init: (init, 4),
    "a block of it": lambda hw, init: (block_of(hw, init), 84),
}
OTHER_READS = {
    "a copy of its array": (lambda _, init: (init.data.copy(),), 84),
    "an array that its array is a part of": (lambda _, __: (WHOLE,), 200),
    "an array of the program": (lambda _, __: (np.zeros(60, np.uint8),), 60),
    "other memory": (lambda hw, _: (hw._board.memory.map(np.zeros(50, np.uint8)), 40), 40),
    "other memory, with its struct placed": (
        lambda hw, init: (hw._board.memory.map(np.zeros(init.address and 50, np.uint8)) + 8, 40),
        40,
    ),
}
WHOLE = np.arange(200, dtype=np.uint8)


@pytest.mark.parametrize("source", MESSAGE_READS.values(), ids=MESSAGE_READS.keys())
def test_a_message_of_a_stream_lies_in_the_slot(source: Any) -> None:
    assert read_bytes(source) == 0


@pytest.mark.parametrize(("source", "size"), OTHER_READS.values(), ids=OTHER_READS.keys())
def test_all_else_has_to_be_read_from_memory(source: Any, size: int) -> None:
    assert read_bytes(source) == size
