"""Boards whose gateways share one software-mapped topic, over all interleavings that hypothesis finds.

Every queue is unbounded and every step of every gateway, delegate and node is a rule of its own, so any order
of events can come up. Nodes publish numbered messages; each receiver must have got each other's numbers in
order, once, and all of them when it was there all the time and everything has come to rest.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from reconros_zenoh.gateway import core
from reconros_zenoh.gateway.filters import Pair, PublisherFilter, conflict


@dataclass(frozen=True)
class Body:
    origin: str
    number: int


@dataclass
class Receiver:
    name: str
    since: dict[str, int]
    got: list[Body] = field(default_factory=list)


class Gateway:
    """The core with its delegate: what `board/gateway.py` does in the model, one step at a time."""

    def __init__(self, board: Board, name: str) -> None:
        self.board = board
        self.name = name
        self.filter = PublisherFilter(name)
        self.from_smt: deque[Body] = deque()
        self.from_hmt: deque[Body] = deque()
        self.osif: deque[Body] = deque()  # the delegate's answer, not read yet
        self.requested = False
        self.state, action = core.step(core.State(), core.Started())
        self.pending: core.Action = action
        self.memory_transfers = 0

    def hear_smt(self, publisher: str, body: Body) -> None:
        if self.filter.passes(publisher):
            self.from_smt.append(body)

    def hear_hmt(self, publisher: str, body: Body) -> None:
        if self.filter.passes(publisher):
            self.from_hmt.append(body)

    def can_respond(self) -> bool:
        return self.requested and bool(self.from_smt) and not self.osif

    def respond(self) -> None:
        self.osif.append(self.from_smt.popleft())

    def events(self) -> list[str]:
        if isinstance(self.pending, core.Request) and self.requested:
            return ["osif"] * bool(self.osif) + ["hmt"] * bool(self.from_hmt)
        return ["act"]

    def advance(self, which: str) -> None:
        if which == "osif":
            self.requested = False
            self._step(core.Responded(self.osif.popleft()))
        elif which == "hmt":
            self._step(core.Arrived(self.from_hmt.popleft()))
        else:
            self._act(self.pending)

    def _act(self, action: core.Action) -> None:
        match action:
            case core.Request():
                assert not self.requested
                assert not self.osif
                self.requested = True
            case core.WriteHmt(body):
                self.memory_transfers += 1
                self.board.put_hmt(self.name, body)
                self._step(core.Transferred())
            case core.WriteMemory():
                self.memory_transfers += 1
                self._step(core.Transferred())
            case core.Cancel():
                assert self.requested
                self.requested = False
                self._step(core.Cancelled(self.osif.popleft() if self.osif else None))
            case core.Publish(body):
                assert not self.requested
                self.board.network.put_smt(self.name, body)
                self._step(core.Published())

    def _step(self, event: core.Event) -> None:
        self.state, self.pending = core.step(self.state, event)


class Board:
    def __init__(self, network: Sharing, name: str) -> None:
        self.network = network
        self.name = name
        self.gateways: dict[Pair, Gateway] = {}
        self.receivers = [Receiver(f"{name}/h{index}", dict(network.published)) for index in range(2)]
        self.declare()

    def declare(self) -> None:
        pair = Pair(f"hmt/{self.name}/t", "/t")
        if conflict(pair, self.gateways) is None:
            self.gateways[pair] = Gateway(self, f"{self.name}/gateway{len(self.gateways)}")

    @property
    def gateway(self) -> Gateway:
        (gateway,) = self.gateways.values()
        return gateway

    def put_hmt(self, publisher: str, body: Body) -> None:
        for receiver in self.receivers:
            receiver.got.append(body)
        for gateway in self.gateways.values():
            gateway.hear_hmt(publisher, body)


class Sharing(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.boards: dict[str, Board] = {}
        self.left: list[Board] = []
        self.published: dict[str, int] = {}
        self.count = 0
        self.forwarded: dict[str, list[Body]] = {}
        self.listener = Receiver("software", {})

    @initialize(boards=st.integers(1, 3))
    def start(self, boards: int) -> None:
        for _ in range(boards):
            self.join()

    def put_smt(self, publisher: str, body: Body) -> None:
        self.forwarded.setdefault(publisher, []).append(body)
        self.listener.got.append(body)
        for board in self.boards.values():
            for gateway in board.gateways.values():
                gateway.hear_smt(publisher, body)

    def _new(self, origin: str) -> Body:
        self.published[origin] = self.published.get(origin, 0) + 1
        return Body(origin, self.published[origin])

    @precondition(lambda self: len(self.boards) < 4)
    @rule()
    def join(self) -> None:
        self.count += 1
        name = f"board{self.count}"
        self.boards[name] = Board(self, name)

    @precondition(lambda self: len(self.boards) > 1)
    @rule(data=st.data())
    def leave(self, data) -> None:
        self.left.append(self.boards.pop(data.draw(st.sampled_from(sorted(self.boards)))))

    @rule(node=st.sampled_from(["s0", "s1"]))
    def publish_in_software(self, node: str) -> None:
        self.put_smt(node, self._new(node))

    @precondition(lambda self: self.boards)
    @rule(data=st.data(), node=st.sampled_from(["p0", "p1"]))
    def publish_in_hardware(self, data, node: str) -> None:
        board = self._any_board(data)
        origin = f"{board.name}/{node}"
        board.put_hmt(origin, self._new(origin))

    @precondition(lambda self: any(board.gateway.can_respond() for board in self.boards.values()))
    @rule(data=st.data())
    def delegate_responds(self, data) -> None:
        able = [name for name, board in self.boards.items() if board.gateway.can_respond()]
        self.boards[data.draw(st.sampled_from(able))].gateway.respond()

    @precondition(lambda self: any(board.gateway.events() for board in self.boards.values()))
    @rule(data=st.data())
    def gateway_advances(self, data) -> None:
        able = [name for name, board in self.boards.items() if board.gateway.events()]
        gateway = self.boards[data.draw(st.sampled_from(able))].gateway
        gateway.advance(data.draw(st.sampled_from(gateway.events())))

    @precondition(lambda self: self.boards)
    @rule(data=st.data())
    def a_second_gateway_on_the_pair_is_refused(self, data) -> None:
        board = self._any_board(data)
        board.declare()
        assert len(board.gateways) == 1

    @invariant()
    def nothing_twice_and_in_order_per_publisher(self) -> None:
        for receiver in self._receivers():
            for origin in self.published:
                numbers = [body.number for body in receiver.got if body.origin == origin]
                assert numbers == sorted(set(numbers)), (receiver.name, origin, numbers)

    @invariant()
    def a_gateway_publishes_only_what_its_own_board_made(self) -> None:
        for publisher, bodies in self.forwarded.items():
            board, _, gateway = publisher.partition("/gateway")
            if gateway:
                assert all(body.origin.startswith(f"{board}/") for body in bodies)

    def teardown(self) -> None:
        # Each round takes a message out of a queue or a core a phase on; a loop would never come to rest.
        rounds = 0
        while busy := [
            b.gateway for b in self.boards.values() if b.gateway.events() or b.gateway.can_respond()
        ]:
            rounds += 1
            assert rounds < 10_000, "messages go round"
            for gateway in busy:
                if gateway.can_respond():
                    gateway.respond()
                elif gateway.events():
                    gateway.advance(gateway.events()[0])
        self.nothing_twice_and_in_order_per_publisher()
        for receiver in self._receivers(present=True):
            for origin, last in self.published.items():
                board = origin.partition("/")[0]
                if board in self.boards or "/" not in origin:  # whoever left took its last messages along
                    first = receiver.since.get(origin, 0)
                    got = [
                        body.number for body in receiver.got if body.origin == origin and body.number > first
                    ]
                    assert got == list(range(first + 1, last + 1)), (receiver.name, origin)
        for board in self.boards.values():
            made = sum(
                count for origin, count in self.published.items() if origin.startswith(f"{board.name}/")
            )
            heard = {body for body in board.receivers[0].got if not body.origin.startswith(f"{board.name}/")}
            assert board.gateway.memory_transfers == made + len(heard)

    def _any_board(self, data) -> Board:
        return self.boards[data.draw(st.sampled_from(sorted(self.boards)))]

    def _receivers(self, *, present: bool = False) -> list[Receiver]:
        boards = [*self.boards.values(), *([] if present else self.left)]
        return [self.listener, *(receiver for board in boards for receiver in board.receivers)]


Sharing.TestCase.settings = settings(
    max_examples=80, stateful_step_count=60, suppress_health_check=list(HealthCheck)
)
TestSharing = Sharing.TestCase
