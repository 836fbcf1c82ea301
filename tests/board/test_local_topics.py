"""Messages between nodes of one board: the times that follow from the constants of [model.topics].

The constants are powers of ten apart, so that a sum tells what it is made of. The MEMIF moves 1 B/ns.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from octets import HEADER, OCTETS, octets
from small_board import TOPICS, desktop, small_board, small_profile

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.local_topics import LocalTopicWriter
from reconros_zenoh.board.sources import SubscriptionSource
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.clock.activity import Activity
from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.gateway.filters import PublisherFilter
from reconros_zenoh.ros.qos import Durability, QosProfile

if TYPE_CHECKING:
    from small_board import Steps

A, D, E, K, L = TOPICS.values()
U = 1000


class Setup:
    """One topic with n hardware subscribers and one in software; who got the message when."""

    def __init__(self, hardware: int, **options: Any) -> None:
        names = [f"h{index}" for index in range(hardware)]
        self.board = small_board(
            small_profile(
                dict.fromkeys([*names, "s"], (0, 0)), topics=TOPICS, cores=4, link_ns=50, **options
            ),
            slots=hardware,
        )
        self.environment = self.board.environment
        self.node = self.board.context.node("n")
        self.got: dict[str, list[tuple[int, Any]]] = {name: [] for name in [*names, "s"]}
        executor = Executor(self.board, 1, hardware)
        for slot, name in enumerate(names):
            source = SubscriptionSource(self.board, self.node, OCTETS, "/a")
            executor.add_hw_callback(name, [slot], CallbackKind.SUB, source, self.hardware(name))
        self.software = SubscriptionSource(self.board, self.node, OCTETS, "/a")
        executor.add_sw_callback(
            "s", CallbackKind.SUB, self.software, lambda message, _: self.note("s", message)
        )
        executor.spin()
        writer = self.board.writer(self.node, OCTETS, "/a")
        assert isinstance(writer, LocalTopicWriter)
        self.writer = writer
        # The first message finds the slots empty.
        self.publish(hardware=True)
        for received in self.got.values():
            received.clear()
        self.started_ns = self.environment.now

    def note(self, name: str, message: Any) -> None:
        self.got[name].append((self.environment.now, message))

    def hardware(self, name: str) -> Any:
        def thread(hardware: Any) -> Steps:
            message = yield from hardware.get_init_data()
            yield from hardware.mem_read(message.data)
            self.note(name, message)

        return thread

    def publish(self, *, hardware: bool, data: Any = None) -> Any:
        body = octets(np.zeros(U, np.uint8) if data is None else data)
        timeline = Timeline(self.environment, self.environment.now)
        if hardware:
            Activity(self.writer.publish(body, timeline))
        else:
            self.writer.send(self.writer.encode(body), timeline)
        self.environment.run()
        return body

    def times(self) -> dict[str, int]:
        return {name: received[0][0] - self.started_ns for name, received in self.got.items()}


@pytest.mark.parametrize("n", [1, 2, 4])
def test_from_hardware_the_readers_share_the_memif_and_software_copies_at_its_speed(n) -> None:
    setup = Setup(n)
    setup.publish(hardware=True)
    assert setup.times() == {
        **{f"h{index}": A + n * D + n * U for index in range(n)},
        "s": A + n * D + U + HEADER,
    }


def test_what_is_published_in_software_and_in_hardware_comes_in_order() -> None:
    setup = Setup(1)
    bodies = [octets(np.array([number], np.uint8)) for number in range(4)]
    timeline = Timeline(setup.environment, setup.environment.now)
    for body in bodies[:3]:
        setup.writer.send(setup.writer.encode(body), timeline.fork())
    Activity(setup.writer.publish(bodies[3], timeline))
    setup.environment.run()
    for received in setup.got.values():
        assert [message.data.tolist() for _, message in received] == [[0], [1], [2], [3]]


def test_a_slot_whose_message_is_pushed_out_goes_on() -> None:
    setup = Setup(1)
    writer = setup.board.writer(setup.node, OCTETS, "/a", QosProfile(depth=1))
    body = octets(np.zeros(U, np.uint8))
    timelines = [Timeline(setup.environment, setup.environment.now) for _ in range(3)]
    for timeline in timelines:
        Activity(writer.publish(body, timeline))
    setup.environment.run()
    assert writer.dropped == 1
    assert [timeline.stages_ns["dds"] for timeline in timelines] == [A + D, 0, 2 * (A + D)]


@pytest.mark.parametrize("n", [1, 2, 4])
def test_from_software_the_publisher_copies_and_readers_in_hardware_slow_the_one_in_software(n) -> None:
    setup = Setup(n)
    setup.publish(hardware=False)
    size = U + HEADER
    assert setup.times() == {
        **{f"h{index}": A + K * size + n * D + n * U for index in range(n)},
        "s": A + K * size + n * E + n * L * size,
    }


def test_all_readers_get_one_copy_of_the_message_and_nothing_leaves_the_board() -> None:
    setup = Setup(2)
    put = []
    setup.writer._publisher.publish_encoded = put.append  # type: ignore[method-assign]
    body = setup.publish(hardware=True)
    copies = [received[0][1].data for received in setup.got.values()]
    assert all(copy is copies[0] for copy in copies)
    assert not np.shares_memory(copies[0], body.data)
    assert not copies[0].flags.writeable
    assert not put


def test_what_a_hardware_callback_publishes_keeps_it_in_the_stage_of_topics() -> None:
    setup = Setup(1)
    timeline = Timeline(setup.environment, setup.environment.now)
    body = octets(np.zeros(U, np.uint8))
    Activity(setup.writer.publish(body, timeline))
    setup.environment.run()
    assert timeline.stages_ns == {"dds": A + D}


def test_an_array_that_nobody_can_change_is_handed_over_by_reference() -> None:
    setup = Setup(2)
    data = np.zeros(U, np.uint8)
    data.flags.writeable = False
    body = setup.publish(hardware=True, data=data)
    assert all(received[0][1].data is body.data for received in setup.got.values())


@pytest.mark.parametrize("hardware", [True, False])
def test_what_becomes_of_a_message_after_it_was_published_is_the_publishers_own_affair(
    hardware: bool,
) -> None:
    setup = Setup(2)
    data = np.zeros(U, np.uint8)

    def change() -> None:
        data[:] = 7

    setup.environment.call_later(A // 2, change)
    setup.publish(hardware=hardware, data=data)
    assert data[0] == 7
    assert [received[0][1].data.any() for received in setup.got.values()] == [False] * 3


def test_a_reader_elsewhere_gets_it_over_the_link_and_those_here_get_it_once() -> None:
    setup = Setup(2)
    heard = []
    desktop(setup.board).node("desk").subscription(
        OCTETS, "/a", lambda _: heard.append(setup.environment.now)
    )
    setup.environment.run()
    setup.publish(hardware=True)
    assert len(heard) == 1
    assert [len(received) for received in setup.got.values()] == [1, 1, 1]
    assert heard[0] - setup.started_ns == A + 2 * D + 50


def test_a_publisher_elsewhere_is_no_reader() -> None:
    setup = Setup(1)
    desktop(setup.board).node("desk").publisher(OCTETS, "/a")
    setup.environment.run()
    assert setup.board.topics is not None
    assert not setup.board.topics.is_read_elsewhere(setup.writer.key)


def test_a_reader_that_has_gone_costs_nothing_any_more() -> None:
    setup = Setup(1)
    node = desktop(setup.board).node("desk")
    node.subscription(OCTETS, "/a", lambda _: None)
    setup.environment.run()
    assert setup.board.topics is not None
    assert setup.board.topics.is_read_elsewhere(setup.writer.key)
    node.close()
    setup.environment.run()
    assert not setup.board.topics.is_read_elsewhere(setup.writer.key)


def test_messages_from_elsewhere_still_come_through_the_stack() -> None:
    setup = Setup(1)
    publisher = desktop(setup.board).node("desk").publisher(OCTETS, "/a")
    setup.environment.run()
    publisher.publish(octets(np.zeros(U, np.uint8)))
    setup.environment.run()
    assert setup.times() == {"h0": 50 + U, "s": 50}


def test_filter_and_check_hold_for_messages_of_the_board() -> None:
    setup = Setup(0)
    own = SubscriptionSource(setup.board, setup.node, OCTETS, "/a", own=PublisherFilter(setup.writer.gid))
    own.open(lambda: None)

    def check(_: Any) -> None:
        raise BadMessageError("image_size", "too small")

    strict = SubscriptionSource(setup.board, setup.node, OCTETS, "/a")
    strict.open(lambda: None, check)
    setup.publish(hardware=False)
    assert (own.is_ready(), strict.is_ready()) == (False, False)
    assert dict(setup.board.context.rejections.counts()) == {"image_size": 1}


def test_a_reader_that_is_too_slow_keeps_the_last() -> None:
    setup = Setup(0)
    lazy = SubscriptionSource(setup.board, setup.node, OCTETS, "/a")
    lazy.open(lambda: None)
    for _ in range(12):
        setup.publish(hardware=False)
    assert lazy.dropped == 2


LATCHED = QosProfile(durability=Durability.TRANSIENT_LOCAL, depth=3)


class Late:
    """What a reader of the board gets that comes when five messages were published, and when."""

    def __init__(
        self, *, from_hardware: bool, to_hardware: bool, writer: QosProfile, reader: QosProfile
    ) -> None:
        self.board = small_board(small_profile(topics=TOPICS, cores=4, link_ns=50))
        self.environment = self.board.environment
        self.from_hardware = from_hardware
        node = self.board.context.node("n")
        self.writer = self.board.writer(node, OCTETS, "/a", writer)
        for number in range(5):
            self.publish(number)
            self.environment.run()
        self.source = SubscriptionSource(self.board, node, OCTETS, "/a", reader)
        self.started_ns = self.environment.now
        self.got: list[tuple[int, int]] = []
        self.source.open(self.note, in_hardware=to_hardware)

    def publish(self, number: int) -> None:
        body = octets(np.full(U, number, np.uint8))
        timeline = Timeline(self.environment, self.environment.now)
        if self.from_hardware:
            Activity(self.writer.publish(body, timeline))
        else:
            self.writer.send(self.writer.encode(body), timeline)

    def note(self) -> None:
        event = self.source.take()
        assert sum(event.timeline.stages_ns.values()) == self.environment.now - event.timeline.started_ns
        self.got.append((self.environment.now - self.started_ns, int(event.message.data[0])))


@pytest.mark.parametrize(
    ("from_hardware", "to_hardware", "each_ns"),
    [(True, True, D), (False, True, D), (True, False, U + HEADER), (False, False, 0)],
)
def test_a_late_reader_gets_what_is_kept_and_only_its_way_costs_time(
    from_hardware: bool, to_hardware: bool, each_ns: int
) -> None:
    late = Late(from_hardware=from_hardware, to_hardware=to_hardware, writer=LATCHED, reader=LATCHED)
    late.environment.run()
    assert late.got == [(each_ns, 2), (2 * each_ns, 3), (3 * each_ns, 4)]
    assert late.source.dropped == 0


def test_what_a_writer_keeps_comes_before_what_it_publishes_next() -> None:
    late = Late(from_hardware=True, to_hardware=True, writer=LATCHED, reader=LATCHED)
    late.publish(5)
    late.environment.run()
    assert [number for _, number in late.got] == [2, 3, 4, 5]


VOLATILE = QosProfile(depth=3)


@pytest.mark.parametrize(
    ("writer", "reader", "numbers"),
    [
        (LATCHED, replace(LATCHED, depth=1), [4]),
        (replace(LATCHED, depth=1), LATCHED, [4]),
        (LATCHED, VOLATILE, []),
        (VOLATILE, LATCHED, []),
    ],
)
def test_a_late_reader_gets_as_many_as_it_wants_and_the_writer_keeps(
    writer: QosProfile, reader: QosProfile, numbers: list[int]
) -> None:
    late = Late(from_hardware=False, to_hardware=False, writer=writer, reader=reader)
    late.environment.run()
    assert [number for _, number in late.got] == numbers
    assert late.source.dropped == 0
