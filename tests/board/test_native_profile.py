"""The profile native: every part is there and costs no modelled time."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import desktop, small_board, stages, types

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from small_board import Steps

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext


LIMIT_S = 30
MS = 1_000_000


def serve_words(
    board: Board, *, in_hardware: bool, kernel: Callable[[int], int] = lambda number: number + 1
) -> Executor:
    """A callback `walk`, of which no profile knows, that publishes what the kernel makes of its number."""
    word = types().message("std_msgs/msg/UInt32")
    node = board.context.node("server")
    source, writer = SubscriptionSource(board, node, word, "in"), TopicWriter(board, node, word, "out")

    def thread(thread: HardwareThread) -> Steps:
        message = yield from thread.get_init_data()
        ram = yield from thread.mem_read(np.array([message.data], np.uint32))
        number = yield from thread.compute(kernel, int(ram[0]))
        yield from thread.mem_write(np.array([number], np.uint32))
        yield from thread.publish(writer, writer.message(data=number))

    def function(message: Any, context: SoftwareContext) -> None:
        context.publish(writer, writer.message(data=context.compute(kernel, message.data)))

    executor = Executor(board, 1, len(board.slots))
    if in_hardware:
        executor.add_hw_callback("walk", [0], CallbackKind.SUB, source, thread)
    else:
        executor.add_sw_callback("walk", CallbackKind.SUB, source, function)
    executor.spin()
    return executor


@pytest.mark.parametrize("in_hardware", [True, False], ids=["hardware", "software"])
def test_a_round_trip_takes_no_modelled_time(in_hardware: bool) -> None:
    board = small_board(read_profile("native"), 1)
    serve_words(board, in_hardware=in_hardware)
    word = types().message("std_msgs/msg/UInt32")
    client = desktop(board).node("client")
    got: list[tuple[int, int]] = []
    client.subscription(
        word, "out", lambda received: got.append((board.environment.now, received.message.data))
    )
    publisher = client.publisher(word, "in")
    for time_ns in (5, 1000):
        board.environment.call_later(time_ns, publisher.publish, word.cls(data=time_ns))
    board.environment.run(until=10**9)
    assert got == [(5, 6), (1000, 1001)]
    assert sum(board.spans.mean_ms()["walk"].values()) == 0
    slot = board.slots[0]
    assert (slot.reconfigurations, slot.reconfiguring.ns, slot.busy.ns) == (int(in_hardware), 0, 0)


def test_a_service_takes_no_modelled_time() -> None:
    board = small_board(read_profile("native"))
    trigger = types().service("std_srvs/srv/Trigger")
    executor = Executor(board, 1, 0)
    source = ServiceSource(board, board.context.node("server"), trigger, "go")
    executor.add_sw_callback(
        "go", CallbackKind.SRV, source, lambda _, __: trigger.response.cls(success=True, message="gone")
    )
    executor.spin()
    client = desktop(board).node("client").client(trigger, "go")
    got: list[tuple[int, Any]] = []

    def answered(response: Any) -> None:
        got.append((board.environment.now, response.message))

    client.call(
        trigger.request.cls(structure_needs_at_least_one_member=0),
        answered,
        10**9,
    )
    board.environment.run(until=10**6)
    assert got == [(0, "gone")]


@pytest.mark.parametrize("in_hardware", [True, False], ids=["hardware", "software"])
def test_in_wall_time_everything_takes_as_long_as_it_takes(in_hardware: bool) -> None:
    environment = WallEnvironment()
    board = small_board(read_profile("native"), 1, environment=environment, threads=2)

    def kernel_of_a_millisecond(_: int) -> int:
        may_end = threading.Event()
        environment.post(environment.call_later, MS, may_end.set)
        return int(may_end.wait(LIMIT_S))

    serve_words(board, in_hardware=in_hardware, kernel=kernel_of_a_millisecond)
    word = types().message("std_msgs/msg/UInt32")
    client = desktop(board).node("client")
    done = environment.event()
    timelines: list[Timeline] = []
    add = board.spans.add

    def note(timeline: Timeline) -> None:
        add(timeline)
        timelines.append(timeline)
        done.succeed()

    board.spans.add = note  # type: ignore[method-assign] # listens only
    publisher = client.publisher(word, "in")
    environment.call_later(0, publisher.publish, word.cls(data=7))
    environment.run(until=done)
    board.close()
    (timeline,) = timelines
    assert timeline.age_ns == sum(timeline.stages_ns.values())
    assert timeline.stages_ns["execution"] >= MS
    assert not {"reconfiguration", "memif", "osif", "dispatch"} & stages(timeline).keys()
    assert board.host.overruns.count == 0


def test_what_is_sent_waits_for_no_computation() -> None:
    environment = WallEnvironment()
    board = small_board(read_profile("native"), environment=environment, threads=1)
    word = types().message("std_msgs/msg/UInt32")
    node = board.context.node("server")
    source, writer = SubscriptionSource(board, node, word, "in"), TopicWriter(board, node, word, "out")
    has_arrived = threading.Event()
    done = environment.event()
    heard: list[bool] = []

    def send() -> None:
        writer.send(writer.encode(writer.message(data=1)), Timeline(environment, environment.now))

    def compute(_: Any, __: SoftwareContext) -> None:
        environment.post(send)
        heard.append(has_arrived.wait(LIMIT_S))
        environment.post(done.succeed)

    executor = Executor(board, 1, 0)
    executor.add_sw_callback("compute", CallbackKind.SUB, source, compute)
    executor.spin()
    client = desktop(board).node("client")
    client.subscription(word, "out", lambda _: has_arrived.set())
    publisher = client.publisher(word, "in")
    environment.call_later(0, publisher.publish, word.cls(data=7))
    environment.run(until=done)
    board.close()
    assert heard == [True]
