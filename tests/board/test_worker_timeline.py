"""The way of a message through a MiniITX board, to the nanosecond (ReconROS Executor, Fig. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import desktop, stages, types

from reconros_zenoh.board.board import Board, SlotPlan
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import Profile, read_profile
from reconros_zenoh.board.quantity import Fraction
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource, TimerSource
from reconros_zenoh.board.spans import Spans
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.profile import CallbackSection
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.spans import Timeline

WORD_OVER_THE_LINK_NS = 270_068  # 0.27 ms and 8 bytes of 8.5 ns
WORD_THROUGH_THE_STACK_NS = 250_160  # 0.25 ms and 8 bytes of 20 ns
INTO_SLOT_0_NS = 17_743_600 + 6_800_000  # 2838976 B at 160 MB/s, offset

# The slot is loaded from 1.2 ms on; the stack needs 3.4 ms after that.
STACK_IS_BACK_NS = 1_200_000 + INTO_SLOT_0_NS + 3_400_000


class Recorder(Spans):
    """Keeps each timeline."""

    def __init__(self) -> None:
        super().__init__()
        self.timelines: list[Timeline] = []

    def add(self, timeline: Timeline) -> None:
        super().add(timeline)
        self.timelines.append(timeline)


def exact(profile: Profile) -> Profile:
    """The profile with nothing random in it."""
    assert profile.model is not None
    none = Fraction(value=0, unit="1", basis="assumed")
    dds = profile.model.dds.model_copy(update={"jitter": none})
    executor = profile.model.executor.model_copy(update={"poll_jitter": none})
    return profile.model_copy(
        update={"model": profile.model.model_copy(update={"dds": dds, "executor": executor})}
    )


class MiniItx:
    """A MiniITX board with slot 0, one worker of each kind, and a log of what happens when."""

    def __init__(self, software_workers: int = 1, hardware_workers: int = 1) -> None:
        self.environment = VirtualEnvironment()
        context = Context(SimulatedNetwork(self.environment).transport("b0"), 0, self.environment.clock_ns)
        self.board = Board(
            self.environment, context, exact(read_profile("miniitx-zynq7100")), (SlotPlan(0, 20800, 160, 60),)
        )
        self.board.spans = self.recorder = Recorder()
        self.node = context.node("server")
        self.client = desktop(self.board).node("client")
        self.executor = Executor(self.board, software_workers, hardware_workers)
        self.log: list[tuple[int, str]] = []

    def time(self, callback: str) -> CallbackSection:
        """How long the callback takes."""
        assert self.board.profile.model is not None
        return self.board.profile.model.callbacks[callback]

    def note(self, what: str) -> None:
        self.log.append((self.environment.now, what))

    def word_topics(self) -> tuple[SubscriptionSource, TopicWriter]:
        """The board's ends of two topics of std_msgs/UInt32."""
        word = types().message("std_msgs/msg/UInt32")
        source = SubscriptionSource(self.board, self.node, word, "angle")
        return source, TopicWriter(self.board, self.node, word, "legangle")

    def start_client(self, *times_ns: int) -> None:
        """Send a word at each of these times; the number is the time."""
        word = types().message("std_msgs/msg/UInt32")
        publisher = self.client.publisher(word, "angle")
        self.client.subscription(
            word, "legangle", lambda received: self.note(f"client gets {received.message.data}")
        )

        def send(number: int) -> None:
            self.note("client sends")
            publisher.publish(word.cls(data=number))

        for number, time_ns in enumerate(times_ns, 1):
            self.environment.call_later(time_ns, send, number)

    def inverse(self, writer: TopicWriter) -> Any:
        """A hardware callback like Listing 3 that notes its steps."""

        def thread(thread: HardwareThread) -> Steps:
            self.note("slot starts")
            message = yield from thread.get_init_data()
            self.note("has init data")
            ram = yield from thread.mem_read(np.array([message.data], np.uint32))
            self.note("has read")
            word = yield from thread.compute(lambda number: number + 100, int(ram[0]))
            self.note("has computed")
            yield from thread.mem_write(np.array([word], np.uint32))
            self.note("has written")
            yield from thread.publish(writer, writer.message(data=word))
            self.note("has published")

        return thread


def test_a_subscriber_in_hardware_with_an_empty_slot_and_then_with_its_bitstream_loaded() -> None:
    itx = MiniItx()
    source, writer = itx.word_topics()
    itx.executor.add_hw_callback("inverse", [0], CallbackKind.SUB, source, itx.inverse(writer))
    itx.executor.spin()
    itx.start_client(0, 40_000_000)
    itx.environment.run(until=50_000_000)
    assert itx.log == [
        (0, "client sends"),
        # 270068 on the link and 250160 in the stack: ready at 520228, found at the first poll, taken in
        # 160000.
        (1_040_000 + 160_000 + INTO_SLOT_0_NS, "slot starts"),
        (25_753_600, "has init data"),
        (25_753_610, "has read"),
        (26_083_610, "has computed"),
        (26_083_620, "has written"),
        (26_093_620, "has published"),
        (STACK_IS_BACK_NS + WORD_THROUGH_THE_STACK_NS + WORD_OVER_THE_LINK_NS, "client gets 101"),
        (40_000_000, "client sends"),
        # Ready at 40520228; the worker has polled since 26093620: the 14th time at 40653620.
        (26_093_620 + 14 * 1_040_000 + 160_000, "slot starts"),
        (40_823_620, "has init data"),
        (40_823_630, "has read"),
        (41_153_630, "has computed"),
        (41_153_640, "has written"),
        (41_163_640, "has published"),
        (41_683_868, "client gets 102"),
    ]
    first, second = itx.recorder.timelines
    assert stages(first) == {
        "transport": 2 * WORD_OVER_THE_LINK_NS,
        "dds": 2 * WORD_THROUGH_THE_STACK_NS + STACK_IS_BACK_NS - 26_093_620,
        "queue": 1_040_000 - 520_228,
        "dispatch": 160_000,
        "reconfiguration": INTO_SLOT_0_NS,
        "osif": 20_000,
        "memif": 20,
        "execution": 330_000,
    }
    assert first.age_ns == 29_663_828
    assert stages(second) == {
        "transport": 2 * WORD_OVER_THE_LINK_NS,
        "dds": 2 * WORD_THROUGH_THE_STACK_NS,
        "queue": 40_653_620 - 40_520_228,
        "dispatch": 160_000,
        "osif": 20_000,
        "memif": 20,
        "execution": 330_000,
    }
    assert second.age_ns == 1_683_868
    slot = itx.board.slots[0]
    assert (slot.reconfigurations, slot.reconfiguring.ns) == (1, INTO_SLOT_0_NS)
    assert slot.busy.ns == 2 * (330_000 + 20_000 + 20)


def test_a_subscriber_in_software() -> None:
    itx = MiniItx()
    source, writer = itx.word_topics()

    def callback(message: Any, context: SoftwareContext) -> None:
        context.publish(writer, writer.message(data=context.compute(abs, message.data)))

    itx.executor.add_sw_callback("inverse", CallbackKind.SUB, source, callback)
    itx.executor.spin()
    itx.start_client(0)
    itx.environment.run(until=20_000_000)
    assert itx.log == [(0, "client sends"), (12_180_228, "client gets 1")]
    (timeline,) = itx.recorder.timelines
    assert stages(timeline) == {
        "transport": 2 * WORD_OVER_THE_LINK_NS,
        "dds": 2 * WORD_THROUGH_THE_STACK_NS,
        "queue": 10_000_000 - 520_228,  # a software worker polls every 10 ms
        "dispatch": 160_000,
        "execution": 1_500_000,
    }
    assert timeline.age_ns == 12_180_228


def test_a_timer_in_hardware() -> None:
    itx = MiniItx()
    _, writer = itx.word_topics()

    def callback(thread: HardwareThread) -> Steps:
        assert (yield from thread.get_init_data()) is None
        digest = yield from thread.compute(abs, -7)
        yield from thread.publish(writer, writer.message(data=digest))

    itx.executor.add_hw_callback("hash", [0], CallbackKind.TMR, TimerSource(itx.board, 250_000_000), callback)
    itx.executor.spin()
    itx.start_client()
    itx.environment.run(until=400_000_000)
    # The 241st poll is the first after the expiry.
    begun_ns = 241 * 1_040_000 + 160_000 + INTO_SLOT_0_NS
    assert itx.log == [(begun_ns + 10_000 + 65_428_000 + 10_000 + 520_228, "client gets 7")]
    (timeline,) = itx.recorder.timelines
    assert timeline.started_ns == 250_000_000
    assert stages(timeline) == {
        "queue": 640_000,
        "dispatch": 160_000,
        "reconfiguration": INTO_SLOT_0_NS,
        "osif": 20_000,
        "execution": 65_428_000,
        "dds": WORD_THROUGH_THE_STACK_NS,
        "transport": WORD_OVER_THE_LINK_NS,
    }
    assert itx.log[0][0] == timeline.started_ns + timeline.age_ns


@pytest.mark.parametrize("in_hardware", [True, False], ids=["hardware", "software"])
def test_a_service_server(in_hardware: bool) -> None:
    itx = MiniItx()
    types().add_service("sorter_msgs/srv/Sort", "uint32[] unsorted\n---\nuint32[] sorted")
    sort = types().service("sorter_msgs/srv/Sort")
    source = ServiceSource(itx.board, itx.node, sort, "sorter")
    numbers = np.arange(2048, dtype=np.uint32)[::-1].copy()

    def thread(thread: HardwareThread) -> Steps:
        request = yield from thread.get_init_data()
        ram = yield from thread.mem_read(request.unsorted)
        ordered = yield from thread.compute(np.sort, ram)
        yield from thread.mem_write(ordered)
        return sort.response.cls(sorted=ordered)

    def function(request: Any, context: SoftwareContext) -> Any:
        return sort.response.cls(sorted=context.compute(np.sort, request.unsorted))

    if in_hardware:
        itx.executor.add_hw_callback("sort", [0], CallbackKind.SRV, source, thread)
    else:
        itx.executor.add_sw_callback("sort", CallbackKind.SRV, source, function)
    itx.executor.spin()
    client = itx.client.client(sort, "sorter")

    def answered(response: Any) -> None:
        assert response.sorted.tolist() == list(range(2048))
        itx.note("client has the answer")

    client.call(sort.request.cls(unsorted=numbers), answered, 10**9)
    itx.environment.run(until=100_000_000)
    (timeline,) = itx.recorder.timelines
    # 8200 bytes each way: 4 of encapsulation, 4 that count the numbers, 8192.
    expected = {"transport": 2 * (270_000 + 69_700), "dds": 2 * (250_000 + 164_000), "dispatch": 160_000}
    if in_hardware:
        answered_ns = 1_200_000 + INTO_SLOT_0_NS + 60_960 + itx.time("sort").compute.ns
        expected |= {
            "queue": 1_040_000 - 753_700,
            "dds": 2 * (250_000 + 164_000) + STACK_IS_BACK_NS - answered_ns,
            "reconfiguration": INTO_SLOT_0_NS,
            "memif": 40_960,
            "execution": itx.time("sort").compute.ns,
            "osif": 20_000,  # the message it starts with, and the response
        }
    else:
        expected |= {"queue": 10_000_000 - 753_700, "execution": itx.time("sort").software.ns}
    assert stages(timeline) == expected
    assert itx.log == [(sum(expected.values()), "client has the answer")]
