"""A message is the publisher's again when it is published, as in ROS 2: what follows does not change it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from octets import OCTETS, octets
from small_board import Tickets, desktop, small_board, small_profile, types

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.sources import ServiceSource
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

# What is sent waits for the stack, so that there is time to change it.
PROFILE = small_profile({"a": (100, 100)}, dds_message_ns=1000)
BIG = 100_000


@pytest.mark.parametrize("hardware", [True, False])
def test_a_callback_that_publishes_one_array_again_and_again(hardware: bool) -> None:
    board = small_board(PROFILE, 1)
    writer = TopicWriter(board, board.context.node("n"), OCTETS, "/out")
    picture = np.zeros(BIG, np.uint8)

    def in_slot(thread: HardwareThread) -> Steps:
        for value in (1, 2):
            picture.fill(value)
            yield from thread.publish(writer, octets(picture))
        picture.fill(3)

    def in_software(_: object, context: SoftwareContext) -> None:
        for value in (1, 2):
            picture.fill(value)
            context.publish(writer, octets(picture))
        picture.fill(3)

    executor, source = Executor(board, 1, 1), Tickets(board)
    if hardware:
        executor.add_hw_callback("a", [0], CallbackKind.SUB, source, in_slot)
    else:
        executor.add_sw_callback("a", CallbackKind.SUB, source, in_software)
    executor.spin()
    got: list[Any] = []
    desktop(board).node("c").subscription(OCTETS, "/out", lambda received: got.append(received.message.data))
    source.put(None)
    board.environment.run(until=1_000_000)
    assert executor.failures == {}
    assert [(data[0], data[-1]) for data in got] == [(1, 1), (2, 2)]


def test_a_service_that_answers_with_one_array_again_and_again() -> None:
    board = small_board(PROFILE)
    types().add_service("lab_msgs/srv/Picture", "uint8 value\n---\nuint8[] data")
    picture_type = types().service("lab_msgs/srv/Picture")
    picture = np.zeros(BIG, np.uint8)

    def answer(request: Any, _: SoftwareContext) -> object:
        picture.fill(request.value)
        return picture_type.response.cls(data=picture)

    executor = Executor(board, 1, 0)
    source = ServiceSource(board, board.context.node("n"), picture_type, "/picture")
    executor.add_sw_callback("a", CallbackKind.SRV, source, answer)
    executor.spin()
    client = desktop(board).node("c").client(picture_type, "/picture")
    got: list[Any] = []
    for value in (1, 2):
        client.call(picture_type.request.cls(value=value), got.append, 10**9)
    board.environment.run(until=1_000_000)
    assert [(response.data[0], response.data[-1]) for response in got] == [(1, 1), (2, 2)]
