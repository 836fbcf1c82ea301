"""A gateway in the model: what it costs, what it forwards, and what it keeps apart.

The MEMIF and a stream move 1 B/ns; the other constants are powers of ten apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from octets import OCTETS, size_of, sized
from small_board import TOPICS, desktop, small_board, small_profile, start, transferred_bytes, types

from reconros_zenoh.board.hmt import Fifo, FifoPlan
from reconros_zenoh.board.profile import Profile, read_profile
from reconros_zenoh.board.sources import SubscriptionSource
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.status import gateways
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, parse, tokens_expression
from reconros_zenoh.ros.qos import Durability, QosProfile, Reliability
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from reconros_zenoh.board.board import Board

A, D, E, K, L = TOPICS.values()
G, C = 100_000_000, 20_000_000
U = 1000


def modelled(**options: Any) -> Profile:
    return small_profile(topics=TOPICS, cores=4, hmt_overhead_ns=G, cancel_ns=C, **options)


class Side:
    """A board with a gateway between /a in hardware and /a in software, and who heard what when on it."""

    def __init__(self, board: Board, subscribers: int = 2, qos: QosProfile | None = None) -> None:
        self.board = board
        self.environment = board.environment
        self.node = board.context.node("n")
        self.topic = board.hardware_topic("/a", OCTETS)
        self.hardware: list[list[tuple[int, Any]]] = [[] for _ in range(subscribers)]
        for heard in self.hardware:
            self._listen(heard)
        self.software: list[tuple[int, Any]] = []
        source = SubscriptionSource(board, self.node, OCTETS, "/a")

        def note() -> None:
            event = source.take()
            self.software.append((self.environment.now, event.message))

        source.open(note)
        self.writer = board.writer(self.node, OCTETS, "/a")
        self.gateway = board.add_gateway("bridge", "/a", "/a", OCTETS, 0, qos)

    def _listen(self, heard: list[tuple[int, Any]]) -> None:
        def note() -> None:
            heard.append((self.environment.now, fifo.take().message))

        fifo = Fifo(FifoPlan(100), note, None, cut_through=False)
        self.topic.subscribe(fifo)

    def publish_in_hardware(self, body: Any) -> None:
        start(
            self.environment,
            self.topic.publish("p", body, size_of(body), Timeline(self.environment, self.environment.now)),
        )

    def publish_in_software(self, body: Any) -> None:
        self.writer.send(self.writer.encode(body), Timeline(self.environment, self.environment.now))

    def numbers(self) -> list[list[int]]:
        return [[int(body.data[0]) for _, body in heard] for heard in (*self.hardware, self.software)]


def times_of(heard: list[tuple[int, Any]], body: Any) -> list[int]:
    """When it was heard, with its own array and nothing else."""
    assert all(message.data is body.data for _, message in heard)
    return [time_ns for time_ns, _ in heard]


@pytest.mark.parametrize("subscribers", [1, 4])
def test_from_hardware_a_message_is_streamed_to_all_and_written_to_memory_once(subscribers: int) -> None:
    side = Side(small_board(modelled(), 2), subscribers)
    body = sized(U)
    side.publish_in_hardware(body)
    side.environment.run()
    assert [times_of(heard, body) for heard in side.hardware] == [[U + G]] * subscribers
    assert times_of(side.software, body) == [U + C + A + D]
    parts_ns = {
        name: {stage: ms * 1e6 for stage, ms in stages_ms.items() if ms}
        for name, stages_ms in side.board.spans.mean_ms().items()
    }
    assert parts_ns == {"": {"hmt": U}, "/bridge": {"gateway": C, "dds": A + D}}
    assert transferred_bytes(side.board) == U


@pytest.mark.parametrize("subscribers", [1, 4])
def test_from_software_it_is_read_from_memory_once_while_it_is_streamed(subscribers: int) -> None:
    side = Side(small_board(modelled(), 2), subscribers)
    body = sized(U)
    side.publish_in_software(body)
    side.environment.run()
    assert [times_of(heard, body) for heard in side.hardware] == [[A + K * U + D + U + G]] * subscribers
    assert times_of(side.software, body) == [A + K * U + E + L * U]
    assert transferred_bytes(side.board) == U


def test_a_message_between_request_and_cancel_is_forwarded() -> None:
    side = Side(small_board(modelled(), 2))
    # Published on the SMT so that it is ready while the core cancels for what came over the HMT.
    side.publish_in_software(sized(U, first=1))
    side.environment.run(until=A + K * U + D - 2 * U)
    side.publish_in_hardware(sized(U, first=2))
    side.environment.run()
    assert side.gateway.late == 1
    assert side.numbers() == [[2, 1], [2, 1], [1, 2]]
    assert (side.gateway.to_hmt, side.gateway.to_smt) == (1, 1)


def test_no_word_is_streamed_before_it_is_read_from_memory() -> None:
    side = Side(small_board(small_profile(cores=4), 2))
    start(side.environment, side.board.memif.transfer(10 * U))  # another slot: half of the bandwidth is left
    for number in (1, 2):
        side.publish_in_software(sized(U, first=number))
    side.environment.run()
    assert [time_ns for time_ns, _ in side.hardware[0]] == [2 * U, 4 * U]


def test_messages_from_both_sides_take_turns() -> None:
    side = Side(small_board(modelled(), 2))
    for number in range(6):
        side.publish_in_software(sized(U, first=number))
        side.publish_in_hardware(sized(U, first=100 + number))
    side.environment.run()
    for heard in side.numbers():
        assert [number for number in heard if number < 100] == list(range(6))
        assert [number for number in heard if number >= 100] == list(range(100, 106))
        assert len(heard) == 12
    # The core had taken 100 and had room for two more before 0 came. From then on each side has its turn, and
    # what comes with the cancel of the hardware's turn goes ahead of the software's.
    assert side.numbers()[0] == [100, 101, 102, 0, 1, 103, 2, 3, 104, 4, 5, 105]
    assert (side.gateway.to_hmt, side.gateway.to_smt, side.gateway.dropped) == (6, 6, 0)


@pytest.mark.parametrize("profile", [modelled(), small_profile(), read_profile("native")])
def test_boards_whose_gateways_share_a_topic_hear_each_other_once(profile: Profile) -> None:
    network = SimulatedNetwork(VirtualEnvironment())
    sides = [Side(small_board(profile, slots=2, network=network, name=f"board{index}")) for index in range(3)]
    network.environment.run()
    heard_elsewhere: list[int] = []
    node = desktop(sides[0].board).node("desk")
    node.subscription(OCTETS, "/a", lambda received: heard_elsewhere.append(int(received.message.data[0])))
    network.environment.run()
    for number, side in enumerate(sides):
        side.publish_in_hardware(sized(U, first=number))
        side.publish_in_software(sized(U, first=10 + number))
    network.environment.run()
    for side in sides:
        for heard in side.numbers():
            assert sorted(heard) == [0, 1, 2, 10, 11, 12]
    assert sorted(heard_elsewhere) == [0, 1, 2, 10, 11, 12]


@pytest.mark.parametrize("topics", [TOPICS, None], ids=["local topics", "network only"])
def test_a_message_that_no_fifo_holds_is_refused_and_the_gateway_goes_on(
    topics: Any, caplog: pytest.LogCaptureFixture
) -> None:
    profile = small_profile(topics=topics, cores=4, hmt_overhead_ns=G, cancel_ns=C)
    side = Side(small_board(profile, 2))
    side.environment.run()
    elsewhere = [desktop(side.board).node(name).publisher(OCTETS, "/a") for name in ("x", "y")]
    side.topic.subscribe(Fifo(FifoPlan(100, message_bytes=U), lambda: None, None, cut_through=False))
    for _ in range(2):
        side.publish_in_software(sized(U + 1, first=1))
        for publisher in elsewhere:
            publisher.publish(sized(U + 1, first=1))
    side.publish_in_software(sized(U, first=2))
    side.environment.run()
    assert side.gateway.refused == 6
    assert side.board.context.rejections.counts() == {"fifo_size": 6}
    assert [heard[-1] for heard in side.numbers()] == [2, 2, 2]
    senders = [side.writer.gid, *(publisher.gid for publisher in elsewhere)]
    assert sorted(text.split(" (")[0] for text in caplog.messages) == sorted(
        f"refused a message on hmt/board0/a from publisher {sender.hex()}" for sender in senders
    )


def test_a_second_gateway_on_a_topic_is_refused_and_so_is_another_type() -> None:
    side = Side(small_board(modelled(), 2))
    for hmt, smt, taken in (("/a", "/b", "hmt/board0/a"), ("/b", "/a", "/a")):
        with pytest.raises(UsageError, match=f"^{taken} has a gateway on board 'board0' already"):
            side.board.add_gateway("second", hmt, smt, OCTETS, 1)
    side.board.hardware_topic("/c", OCTETS)
    with pytest.raises(UsageError, match="has the type std_msgs/msg/UInt8MultiArray"):
        side.board.add_gateway("second", "/c", "/c", types().message("std_msgs/msg/UInt32"), 1)
    side.publish_in_software(sized(U, first=1))
    side.environment.run()
    assert side.numbers() == [[1], [1], [1]]


def test_its_slot_holds_it_from_the_start_and_nothing_else() -> None:
    side = Side(small_board(modelled(), 2))
    slot = side.board.slots[0]
    assert slot.holds is not None
    assert (slot.holds.callback, slot.reconfigurations) == ("bridge", 0)
    with pytest.raises(UsageError, match="'second' cannot be in slot 0, which is for bridge"):
        side.board.add_gateway("second", "/b", "/b", OCTETS, 0)
    with pytest.raises(UsageError, match=r"there is no slot 9. The board has \["):
        side.board.add_gateway("second", "/b", "/b", OCTETS, 9)


def test_its_ends_have_its_qos() -> None:
    board = small_board(modelled(), 2)
    qos = QosProfile(Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL, depth=3)
    board.add_gateway("bridge", "/a", "/a", OCTETS, 0, qos)
    seen = [parse(key) for key in desktop(board).transport.tokens(tokens_expression(0), 0)]
    ends = {token.kind: token.qos for token in seen if isinstance(token, EndpointToken)}
    assert ends == {EndpointKind.PUBLISHER: qos, EndpointKind.SUBSCRIPTION: qos}


def test_one_that_is_added_late_gets_what_a_publisher_of_its_board_keeps() -> None:
    board = small_board(modelled(), 2)
    qos = QosProfile(durability=Durability.TRANSIENT_LOCAL, depth=2)
    writer = board.writer(board.context.node("n"), OCTETS, "/a", qos)
    for number in range(5):
        writer.send(writer.encode(sized(U, first=number)), Timeline(board.environment, board.environment.now))
        board.environment.run()
    heard: list[int] = []
    fifo = Fifo(FifoPlan(), lambda: heard.append(int(fifo.take().message.data[0])), None, cut_through=False)
    board.hardware_topic("/a", OCTETS).subscribe(fifo)
    board.add_gateway("late", "/a", "/a", OCTETS, 0, qos, at_power_up=False)
    board.environment.run()
    assert heard == [3, 4]


def test_with_a_short_queue_it_keeps_the_newest() -> None:
    side = Side(small_board(modelled(), 2), qos=QosProfile(depth=1))
    nobody_takes = Fifo(FifoPlan(depth=1), lambda: None, None, cut_through=False)
    side.topic.subscribe(nobody_takes)
    for number in range(5):
        side.publish_in_software(sized(U, first=number))
    side.environment.run()
    # 0 fills the FIFO, the core waits with 1; 4 has pushed 2 and 3 out.
    assert side.gateway.dropped == 2
    for _ in range(3):
        nobody_takes.take()
        side.environment.run()
    assert side.numbers() == [[0, 1, 4], [0, 1, 4], [0, 1, 2, 3, 4]]


def test_it_takes_no_slot_of_a_callback() -> None:
    board = small_board(modelled(), 1)
    board.slots[0].admit("loaded")
    with pytest.raises(UsageError, match=r"'g' cannot be in slot 0, which is for loaded\. Give one of them"):
        board.add_gateway("g", "/a", "/a", OCTETS, 0)


def test_a_profile_must_know_gateways() -> None:
    profile = modelled()
    assert profile.model is not None
    ignorant = profile.model_copy(update={"model": profile.model.model_copy(update={"gateway": None})})
    with pytest.raises(UsageError, match=r"\[model.gateway\]"):
        small_board(ignorant, 1).add_gateway("g", "/a", "/a", OCTETS, 0)


def test_a_closed_board_takes_its_gateway_out_of_the_graph() -> None:
    network = SimulatedNetwork(VirtualEnvironment())
    left, stays = (
        Side(small_board(modelled(), slots=2, network=network, name=f"board{index}")) for index in (1, 2)
    )
    network.environment.run()
    left.board.close()
    left.node.close()
    stays.publish_in_hardware(sized(U, first=1))
    network.environment.run()
    assert stays.numbers() == [[1], [1], [1]]
    assert left.numbers() == [[], [], []]


def test_the_status_tells_what_passed() -> None:
    side = Side(small_board(modelled(), 2))
    side.publish_in_software(sized(U, first=1))
    side.publish_in_hardware(sized(U, first=2))
    side.environment.run()
    assert gateways(side.board) == [
        {
            "name": "bridge",
            "hmt": "hmt/board0/a",
            "smt": "/a",
            "type": "std_msgs/msg/UInt8MultiArray",
            "qos": QosProfile().words(),
            "slot": 0,
            "to_hmt": 1,
            "to_smt": 1,
            "late": 1,
            "dropped": 0,
            "refused": 0,
        }
    ]
