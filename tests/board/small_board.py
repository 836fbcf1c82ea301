"""Boards of which every time is nothing, except what a test names: what is left is what the test is about."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from reconros_zenoh.board.board import Board, SlotPlan
from reconros_zenoh.board.profile import Profile
from reconros_zenoh.board.sources import Event, Source
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.clock.activity import Activity
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Generator, Mapping

    import simpy

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

    Steps = Generator[Any, Any, Any]
    """What waits for parts of a board with `yield from`."""

BITSTREAM_BYTES = 2000
"""Of every slot; the ICAP takes two bytes per nanosecond, so that a write takes 1000 ns."""

TOPICS = {
    "publish": 1_000_000,
    "notify_hardware": 10_000,
    "notify_software": 9_000,
    "copy_in": 3,
    "copy_out": 0.5,
}
"""Constants of topics inside the board, so far apart that a sum tells what it is made of."""

types = cache(TypeRegistry)


def small_profile(
    callbacks: Mapping[str, tuple[int, int]] | None = None,
    *,
    cores: int = 2,
    hardware_poll_ns: int = 0,
    software_poll_ns: int = 0,
    poll_jitter: float = 0,
    dispatch_ns: int = 0,
    dds_message_ns: int = 0,
    dds_byte_ns: float = 0,
    dds_byte_received_ns: float = 0,
    dds_byte_sent_ns: float = 0,
    large_from: int = 65536,
    nack_probability: float = 0,
    nack_delay_ns: int = 0,
    loss_probability: float = 0,
    loss_probability_busy: float = 0,
    heartbeat_ns: int = 0,
    core_share: float = 1,
    jitter: float = 0,
    recovery_ns: int = 0,
    stalled: bool = False,
    link_ns: int = 0,
    link_byte_ns: float = 0,
    icap_offset_ns: int = 0,
    osif_ns: int = 0,
    hmt_overhead_ns: int = 0,
    cancel_ns: int = 0,
    topics: Mapping[str, float] | None = None,
) -> Profile:
    """`callbacks` gives each name its time in software and what its slot computes; the MEMIF moves 1 B/ns.

    A hardware-mapped topic moves 1 B/ns, too. `topics` are the constants of topics inside the board.
    """

    def of(value: float, unit: str) -> dict[str, object]:
        return {"value": value, "unit": unit, "basis": "assumed"}

    model = {
        "cores": {"count": of(cores, "1"), "clock": of(1, "GHz")},
        "fabric": {"thread_clock": of(1, "GHz")},
        "executor": {
            "hardware_poll": of(hardware_poll_ns, "ns"),
            "software_poll": of(software_poll_ns, "ns"),
            "poll_jitter": of(poll_jitter, "1"),
            "dispatch": of(dispatch_ns, "ns"),
        },
        "dds": {
            "per_message": of(dds_message_ns, "ns"),
            "per_byte": of(dds_byte_ns, "ns/B"),
            "receive_per_byte_large": of(dds_byte_received_ns, "ns/B"),
            "send_per_byte_large": of(dds_byte_sent_ns, "ns/B"),
            "large_from": of(large_from, "B"),
            "nack_probability": of(nack_probability, "1"),
            "nack_delay": of(nack_delay_ns, "ns"),
            "loss_probability": of(loss_probability, "1"),
            "loss_probability_busy": of(loss_probability_busy, "1"),
            "heartbeat_period": of(heartbeat_ns, "ns"),
            "core_share": of(core_share, "1"),
            "jitter": of(jitter, "1"),
            "recovery": of(recovery_ns, "ns"),
            "stalled_by_reconfiguration": stalled,
        },
        "link": {"latency": of(link_ns, "ns"), "per_byte": of(link_byte_ns, "ns/B")},
        "icap": {"bandwidth": of(2, "GB/s"), "offset": of(icap_offset_ns, "ns")},
        "memif": {"bandwidth": of(1, "GB/s")},
        "osif": {"call": of(osif_ns, "ns")},
        "bitstreams": [{"lut": 100, "dsp": 0, "bram36": 0, "size": of(BITSTREAM_BYTES, "B")}],
        "callbacks": {
            name: {"software": of(software_ns, "ns"), "compute": of(compute_ns, "ns")}
            for name, (software_ns, compute_ns) in (callbacks or {}).items()
        },
    }
    model["hmt"] = {"overhead": of(hmt_overhead_ns, "ns"), "bandwidth": of(1, "GB/s")}
    model["gateway"] = {"cancel": of(cancel_ns, "ns")}
    if topics is not None:
        model["topics"] = {
            name: of(topics.get(name, 0), "ns/B" if name.startswith("copy") else "ns")
            for name in ("publish", "notify_hardware", "notify_software", "copy_in", "copy_out")
        }
    return Profile.model_validate({"name": "small", "description": "", "model": model})


def transferred_bytes(board: Board) -> int:
    """What has crossed the MEMIF of a small board, which moves 1 B/ns."""
    return round(board.memif.bus.use(duration_ns=1))


def start(environment: VirtualEnvironment, steps: Steps) -> simpy.Event:
    """Begin to go through the steps now; the event happens, with what they return or raise, when they end."""
    end = environment.event()

    def follow() -> Steps:
        try:
            end.succeed((yield from steps))
        except Exception as error:  # noqa: BLE001 - whatever it is, it belongs to who waits for the end
            end.fail(error)

    Activity(follow())
    return end


def small_board(
    profile: Profile,
    slots: int = 0,
    *,
    environment: VirtualEnvironment | None = None,
    threads: int | None = None,
    pointer_bytes: int = 4,
    network: SimulatedNetwork | None = None,
    name: str = "board0",
    static: Container[int] = (),
    traced: bool = False,
) -> Board:
    """A board in a network of its own, or in this one; the `static` slots are not reconfigurable."""
    if network is None:
        network = SimulatedNetwork(environment or VirtualEnvironment())
    environment = network.environment
    session = f"b{name.removeprefix('board')}"
    context = Context(network.transport(session), 0, environment.clock_ns)
    plans = tuple(SlotPlan(slot, 100, 0, 0, None, slot not in static) for slot in range(slots))
    return Board(
        environment,
        context,
        profile,
        plans,
        threads=threads,
        name=name,
        pointer_bytes=pointer_bytes,
        traced=traced,
    )


def desktop(board: Board) -> Context:
    """Another session in the network of the board."""
    network = board.context.transport._network  # type: ignore[attr-defined] # it is a simulated one
    return Context(network.transport("c0"), 0, board.environment.clock_ns)


class Tickets(Source):
    """A source that a test fills by hand, without any communication."""

    def __init__(self, board: Board) -> None:
        super().__init__()
        self._environment = board.environment
        self.timelines: list[Timeline] = []
        self.answers: list[tuple[object, object]] = []
        self.on_answer: Callable[[], object] = lambda: None

    def put(self, message: object) -> None:
        timeline = Timeline(self._environment, self._environment.now)
        self.timelines.append(timeline)
        self.enqueue(Event(message, timeline))

    def put_at(self, *times_ns: int) -> None:
        """Put a ticket at each of these times; the message is the time."""
        for time_ns in times_ns:
            self._environment.call_later(time_ns - self._environment.now, self.put, time_ns)

    def answer(self, event: Event, response: object) -> None:
        self.answers.append((event.message, response))
        self.on_answer()


Log = list[tuple[int, str]]


def logging_thread(log: Log, name: str) -> Callable[[HardwareThread], Steps]:
    """A hardware callback that notes when its slot starts and is done computing."""

    def thread(thread: HardwareThread) -> Steps:
        log.append((thread._environment.now, f"{name} starts"))
        yield from thread.compute(int)
        log.append((thread._environment.now, f"{name} is done"))

    return thread


def stages(timeline: Timeline) -> dict[str, int]:
    """The stages that took any time [ns]."""
    return {stage: taken_ns for stage, taken_ns in timeline.stages_ns.items() if taken_ns}


def ignore(_: Any, __: SoftwareContext) -> None:
    """A software callback that does nothing."""
