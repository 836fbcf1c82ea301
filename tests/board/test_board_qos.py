"""Quality of service on a board: how many messages wait, what may be lost, what a late reader gets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from octets import OCTETS, octets
from small_board import desktop, small_board, small_profile, types

from reconros_zenoh.board.sources import SubscriptionSource
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.ros.qos import Durability, History, QosProfile, Reliability

WORD = types().message("std_msgs/msg/UInt32")
LARGE = np.zeros(1000, np.uint8)


def received(
    qos: QosProfile, count: int, profile: Any, message_type: Any, message: Any
) -> SubscriptionSource:
    """A source to which so many messages came."""
    board = small_board(profile)
    source = SubscriptionSource(board, board.context.node("reader"), message_type, "in", qos)
    source.open(lambda: None)
    publisher = desktop(board).node("client").publisher(message_type, "in")
    for _ in range(count):
        publisher.publish(message)
        board.environment.run(until=board.environment.now + 1000)
    board.environment.run(until=board.environment.now + 10**7)
    return source


@pytest.mark.parametrize(
    ("qos", "kept"),
    [(QosProfile(depth=3), 3), (QosProfile(), 10), (QosProfile(history=History.KEEP_ALL, depth=3), 50)],
)
def test_how_many_messages_wait(qos: QosProfile, kept: int) -> None:
    source = received(qos, 50, small_profile(), WORD, WORD.cls(data=1))
    assert (len(source._queue), source.dropped) == (kept, 50 - kept)


LOSSY = small_profile(large_from=500, nack_probability=0.3, nack_delay_ns=10, loss_probability=0.2)


@pytest.mark.parametrize("reliability", Reliability)
def test_a_lost_fragment_is_sent_again_or_the_message_is_lost(reliability: Reliability) -> None:
    qos = QosProfile(reliability, history=History.KEEP_ALL)
    source = received(qos, 200, LOSSY, OCTETS, octets(LARGE))
    arrived = len(source._queue)
    assert arrived + source.dropped == 200
    if reliability is Reliability.RELIABLE:
        assert arrived == 200
    else:
        assert 80 < arrived < 145  # 112 expected: 0.8 times 0.7 of them


def test_small_messages_are_one_fragment() -> None:
    qos = QosProfile(Reliability.BEST_EFFORT, history=History.KEEP_ALL)
    assert received(qos, 100, LOSSY, OCTETS, octets(LARGE[:9])).dropped == 0


@pytest.mark.parametrize("reliability", Reliability)
def test_what_the_board_sends_arrives(reliability: Reliability) -> None:
    board = small_board(LOSSY)
    qos = QosProfile(reliability, history=History.KEEP_ALL)
    writer = TopicWriter(board, board.context.node("writer"), OCTETS, "out", qos)
    got: list[Any] = []
    desktop(board).node("client").subscription(OCTETS, "out", got.append)
    for _ in range(200):
        writer.send(writer.encode(octets(LARGE)), Timeline(board.environment, board.environment.now))
    board.environment.run(until=10**9)
    assert len(got) == 200
    assert writer.dropped == 0


@pytest.mark.parametrize("topics", [None, {}], ids=["network only", "local topics"])
@pytest.mark.parametrize("durability", Durability)
def test_a_late_reader_gets_the_last_messages_of_a_transient_local_writer(
    durability: Durability, topics: dict[str, float] | None
) -> None:
    board = small_board(small_profile(topics=topics))
    qos = QosProfile(durability=durability, depth=2)
    writer = board.writer(board.context.node("writer"), WORD, "out", qos)
    for number in range(5):
        parts = writer.encode(writer.message(data=number))
        writer.send(parts, Timeline(board.environment, board.environment.now))
        board.environment.run(until=board.environment.now + 10)
    got: list[int] = []
    desktop(board).node("late").subscription(
        WORD, "out", lambda received: got.append(received.message.data), qos
    )
    board.environment.run(until=board.environment.now + 10)
    assert got == ([3, 4] if durability is Durability.TRANSIENT_LOCAL else [])
