"""Queues of the board: KEEP_LAST drops the oldest and counts it, and timer expiries merge."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from small_board import desktop, small_board, small_profile, stages, start, types

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource, TimerSource
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import TopicWriter, Writer
from reconros_zenoh.errors import TransportError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.board.software import SoftwareContext


class Subscriber:
    """A board whose callback takes 1000 ns and notes what it got when."""

    def __init__(self, profile: Profile, depth: int = 2) -> None:
        self.board = small_board(profile)
        self.environment = self.board.environment
        self.word = types().message("std_msgs/msg/UInt32")
        self.log: list[tuple[int, int]] = []
        self.source = SubscriptionSource(
            self.board, self.board.context.node("server"), self.word, "in", QosProfile(depth=depth)
        )
        self.executor = Executor(self.board, 1, 0)
        self.executor.add_sw_callback("a", CallbackKind.SUB, self.source, self._callback)
        self.executor.spin()
        self._publisher = desktop(self.board).node("client").publisher(self.word, "in")

    def _callback(self, message: Any, _: SoftwareContext) -> None:
        self.log.append((self.environment.now, message.data))

    def publish_at(self, time_ns: int, *numbers: int) -> None:
        for number in numbers:
            self.environment.call_later(time_ns, self._publisher.publish, self.word.cls(data=number))


def test_the_oldest_message_is_pushed_out_while_the_worker_is_busy() -> None:
    board = Subscriber(small_profile({"a": (1000, 0)}))
    for number in range(1, 6):
        board.publish_at(10 * number, number)
    board.environment.run(until=10_000)
    # 1 is taken at once; then two may wait, and 4 and 5 push out 2 and 3.
    assert board.log == [(10, 1), (1010, 4), (2010, 5)]
    assert board.source.dropped == 2
    assert board.executor.statistics()["a"]["dropped"] == 2


def test_nothing_is_dropped_while_the_queue_has_room() -> None:
    board = Subscriber(small_profile({"a": (1000, 0)}), depth=3)
    for number in range(1, 5):
        board.publish_at(10 * number, number)
    board.environment.run(until=10_000)
    assert [number for _, number in board.log] == [1, 2, 3, 4]
    assert board.source.dropped == 0


def test_the_oldest_message_is_pushed_out_while_the_stack_is_busy() -> None:
    board = Subscriber(small_profile({"a": (1, 0)}, dds_message_ns=100))
    board.publish_at(0, 1)
    board.publish_at(50, 2, 3, 4, 5)
    board.environment.run(until=10_000)
    assert board.log == [(100, 1), (200, 4), (300, 5)]
    assert board.source.dropped == 2


def test_the_time_of_a_message_counts_from_its_source_timestamp() -> None:
    board = small_board(small_profile({"a": (1000, 0)}, link_ns=500))
    word = types().message("std_msgs/msg/UInt32")
    source = SubscriptionSource(board, board.context.node("server"), word, "in")
    source.open(lambda: None)
    sender = desktop(board)
    sender.clock_ns = lambda: board.environment.now - 300  # it was on its way for 300 ns
    publisher = sender.node("client").publisher(word, "in")
    board.environment.call_later(1000, publisher.publish, word.cls(data=1))
    board.environment.run(until=5000)
    timeline = source.take().timeline
    assert timeline.started_ns == 700
    assert timeline.stages_ns["transport"] == 500
    assert timeline.stages_ns["queue"] == 5000 - 1200


def test_what_waited_behind_another_message_has_crossed_the_link_meanwhile() -> None:
    board = Subscriber(small_profile({"a": (1, 0)}, dds_message_ns=100, link_ns=70), depth=10)
    board.publish_at(0, 1, 2, 3)
    board.environment.run(until=10_000)
    # The link is crossed once, then the stack takes 100 ns for each.
    assert board.log == [(170, 1), (270, 2), (370, 3)]


def test_what_waited_behind_another_message_was_not_in_the_real_network_meanwhile() -> None:
    """So what the board sends has the whole link before it, see `DdsStack`."""
    board = Subscriber(small_profile({"a": (1, 0)}, dds_message_ns=100, link_ns=70), depth=10)
    board.publish_at(0, *range(9))
    board.environment.run(until=10_000)
    timeline = Timeline(board.environment, board.environment.now)
    board.environment.run(until=start(board.environment, board.board.dds.send(0, timeline)))
    assert stages(timeline) == {"dds": 100, "transport": 70}


def test_messages_come_in_the_order_in_which_they_were_sent() -> None:
    board = Subscriber(small_profile({"a": (1, 0)}, dds_byte_ns=3), depth=100)
    board.publish_at(0, *range(50))
    board.environment.run(until=100_000)
    assert [number for _, number in board.log] == list(range(50))


def test_requests_wait_ten_deep() -> None:
    board = small_board(small_profile({"a": (1000, 0)}))
    trigger = types().service("std_srvs/srv/Trigger")
    source = ServiceSource(board, board.context.node("server"), trigger, "go")
    executor = Executor(board, 1, 0)
    executor.add_sw_callback(
        "a", CallbackKind.SRV, source, lambda _, __: trigger.response.cls(success=True, message="")
    )
    executor.spin()
    client = desktop(board).node("client").client(trigger, "go")
    answers: list[int] = []

    def answered(number: int, answer: Any) -> None:
        if not isinstance(answer, TransportError):
            answers.append(number)

    for number in range(12):
        request = trigger.request.cls(structure_needs_at_least_one_member=0)
        client.call(request, partial(answered, number), 10**6)
        board.environment.run(until=board.environment.now + 10)
    board.environment.run(until=10**7)
    assert answers == [0, *range(2, 12)]
    assert source.dropped == 1


def test_a_writer_sends_in_order_and_pushes_out_the_oldest() -> None:
    board = small_board(small_profile(dds_message_ns=100))
    writer = Writer(board, QosProfile(depth=2))
    log: list[tuple[int, str]] = []

    def sent(name: str) -> None:
        log.append((board.environment.now, name))

    for name in "abcde":
        writer.put((b"1234",), Timeline(board.environment, 0), partial(sent, name))
    board.environment.run(until=1000)
    assert log == [(100, "a"), (200, "d"), (300, "e")]
    assert writer.dropped == 2


def test_the_size_of_a_message_is_that_of_all_its_parts() -> None:
    board = small_board(small_profile(dds_byte_ns=1))
    timeline = Timeline(board.environment, 0)
    Writer(board, QosProfile(depth=1)).put((b"head", bytes(100)), timeline, lambda: None)
    board.environment.run(until=1000)
    assert timeline.stages_ns["dds"] == 104


def test_a_topic_writer_counts_what_it_dropped() -> None:
    board = small_board(small_profile(dds_message_ns=100))
    word = types().message("std_msgs/msg/UInt32")
    got: list[int] = []
    desktop(board).node("client").subscription(
        word, "out", lambda received: got.append(received.message.data)
    )
    writer = TopicWriter(board, board.context.node("server"), word, "out", QosProfile(depth=1))
    for number in range(4):
        writer.send(writer.encode(writer.message(data=number)), Timeline(board.environment, 0))
    board.environment.run(until=1000)
    assert got == [0, 3]
    assert writer.dropped == 2


class TimerBoard:
    """A timer of 1000 ns whose callback takes a given time."""

    def __init__(self, callback_ns: int) -> None:
        self.board = small_board(small_profile({"a": (callback_ns, 0)}))
        self.timer = TimerSource(self.board, 1000)
        self.starts: list[int] = []
        self.executor = Executor(self.board, 1, 0)
        self.executor.add_sw_callback("a", CallbackKind.TMR, self.timer, self._callback)
        self.executor.spin()

    def _callback(self, message: None, _: SoftwareContext) -> None:
        assert message is None
        self.starts.append(self.board.environment.now)


def test_a_timer_expires_first_after_its_period_and_then_every_period() -> None:
    timer = TimerBoard(callback_ns=300)
    timer.board.environment.run(until=4500)
    assert timer.starts == [1000, 2000, 3000, 4000]
    assert timer.timer.dropped == 0


def test_a_timer_does_not_drift_when_its_callback_is_late() -> None:
    timer = TimerBoard(callback_ns=1300)
    timer.board.environment.run(until=7000)
    assert timer.starts == [1000, 2300, 3600, 4900, 6200]


def test_expiries_that_nobody_took_merge_into_one_and_are_counted() -> None:
    timer = TimerBoard(callback_ns=3300)
    timer.board.environment.run(until=8500)
    # Taken at 1000; 2000 waits, 3000 and 4000 merge into it; taken at 4300; 5000 waits, 6000 and 7000 merge.
    assert timer.starts == [1000, 4300, 7600]
    assert timer.timer.dropped == 4
    assert timer.executor.statistics()["a"]["dropped"] == 4


def test_the_time_of_merged_expiries_counts_from_the_first() -> None:
    board = small_board(small_profile())
    timer = TimerSource(board, 1000)
    timer.open(lambda: None)
    board.environment.run(until=2500)
    event = timer.take()
    assert event.timeline.started_ns == 1000
    assert event.timeline.stages_ns == {"queue": 1500}
    assert not timer.is_ready()
