"""What a board tells about itself, and who may have its name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgpack
import pytest
from small_board import Tickets, desktop, logging_thread, small_board, small_profile, types

from reconros_zenoh.board import control
from reconros_zenoh.board.control import ControlServer, alive_key, ask_status, claim_name
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.sources import SubscriptionSource
from reconros_zenoh.board.status import status
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.errors import BadMessageError, TransportError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.transport.base import Reply
from reconros_zenoh.transport.simulated import SimulatedNetwork, SimulatedTransport

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from reconros_zenoh.board.board import Board

PROFILE = small_profile({"a": (1_000_000, 2_000_000), "b": (1_000_000, 0)}, osif_ns=500_000)


def board_that_ran() -> tuple[Board, Executor]:
    """One with a callback that ran in slot 0, one that ran in software and failed once, and a spare slot."""
    board = small_board(PROFILE, 2)
    executor = Executor(board, 1, 1)
    a, b = Tickets(board), Tickets(board)
    executor.add_hw_callback("a", [0], CallbackKind.SUB, a, logging_thread([], "a"))
    executor.add_sw_callback("b", CallbackKind.TMR, b, lambda message, _: 1 / message)
    executor.spin()
    for source, *tickets in ((a, 5, 5), (b, 1, 0)):
        for ticket in tickets:
            source.put(ticket)
    board.environment.run(until=10_000_000)
    return board, executor


def test_the_status_of_a_board() -> None:
    board, executor = board_that_ran()
    assert status(board, executor) == {
        "version": 1,
        "board": "board0",
        "profile": "small",
        "domain": 0,
        "executor": "reconros",
        "elapsed_ms": 10.0,
        "callbacks": {
            "a": {
                "kind": "SUB",
                "software": False,
                "slots": [0],
                "timing": {"slot 0": {"basis": "table", "ms": 2.0}},
                "calls": 2,
                "failed": 0,
                "dropped": 0,
                "running": [],
            },
            "b": {
                "kind": "TMR",
                "software": True,
                "slots": [],
                "timing": {"software": {"basis": "table", "ms": 1.0}},
                "calls": 2,
                "failed": 1,
                "dropped": 0,
                "running": [],
            },
        },
        "slots": [
            {
                "id": 0,
                "holds": "a",
                "reconfigurations": 1,
                "reconfiguration_ms": 0.001,
                "icap_wait_ms": 0.0,
                "busy_ms": 4.0,
            },
            {
                "id": 1,
                "holds": None,
                "reconfigurations": 0,
                "reconfiguration_ms": 0.0,
                "icap_wait_ms": 0.0,
                "busy_ms": 0.0,
            },
        ],
        "use": {"cores": 0.1, "icap": 0.0001, "memif": 0.0, "stack": 0.0},
        "publishers": {},
        "gateways": [],
        "hmt": {},
        "spans_ms": {
            "a": {
                "queue": 1.0005,
                "dispatch": 0.0,
                "reconfiguration": 0.0005,
                "execution": 2.0,
                "overrun": 0.0,
            },
            "b": {"queue": 0.0, "dispatch": 0.0, "execution": 1.0, "overrun": 0.0},
        },
        "rejected": {},
        "host": {
            "overruns": 0,
            "overrun_ms": 0.0,
            "lag_p50_us": None,
            "lag_p99_us": None,
            "real_time_priority": None,
        },
    }


def test_the_status_counts_what_was_refused() -> None:
    board = small_board(PROFILE)
    word = types().message("std_msgs/msg/UInt32")
    executor = Executor(board, 1, 0)

    def refuse_nought(message: Any) -> None:
        if message.data == 0:
            raise BadMessageError("leg", "nought")

    node = board.context.node("server")
    source = SubscriptionSource(board, node, word, "in")
    executor.add_sw_callback("a", CallbackKind.SUB, source, lambda _, __: None, refuse_nought)
    executor.spin()
    publisher = desktop(board).node("client").publisher(word, "in")
    for number in (0, 1, 0):
        publisher.publish(word.cls(data=number))
    board.environment.run(until=10_000_000)
    told = status(board, executor)
    assert told["rejected"] == {"leg": 2}
    assert told["callbacks"]["a"]["calls"] == 1


def test_the_status_tells_how_old_messages_were_when_they_left() -> None:
    board = small_board(PROFILE)
    word = types().message("std_msgs/msg/UInt32")
    executor = Executor(board, 1, 0)
    node = board.context.node("server")
    writer, second, idle = (board.writer(node, word, topic) for topic in ("out", "out", "idle"))

    def answer(message: Any, context: Any) -> None:
        context.publish(second if message.data else writer, message)

    executor.add_sw_callback("a", CallbackKind.SUB, SubscriptionSource(board, node, word, "in"), answer)
    executor.spin()
    publisher = desktop(board).node("client").publisher(word, "in")
    for number in range(2):
        publisher.publish(word.cls(data=number))
    board.environment.run(until=10_000_000)
    told = status(board, executor)["publishers"]
    assert told["/idle"] == {
        "sent": 0,
        "dropped": idle.dropped,
        "age_p50_ms": None,
        "age_p95_ms": None,
        "age_max_ms": None,
    }
    # `a` takes 1 ms in software, and the second message waits for the first.
    ages = {"age_p50_ms": 1.5, "age_p95_ms": pytest.approx(1.95), "age_max_ms": 2.0}
    assert told["/out"] == {"sent": 2, "dropped": 0, **ages}


def test_in_wall_time_the_status_says_how_late_the_event_loop_was() -> None:
    environment = WallEnvironment()
    board = small_board(PROFILE, environment=environment, threads=1)
    environment.run(until=environment.timeout(1))
    host = status(board, Executor(board, 1, 0))["host"]
    board.close()
    assert host["overruns"] == 0
    assert host["lag_p50_us"] >= 0
    assert host["lag_p99_us"] >= host["lag_p50_us"]


def test_the_status_says_how_often_and_how_long_the_host_was_too_slow() -> None:
    board, executor = board_that_ran()
    board.host.overruns.count, board.host.overruns.total_ns = 2, 3_500_000
    assert status(board, executor)["host"]["overruns"] == 2
    assert status(board, executor)["host"]["overrun_ms"] == 3.5


@pytest.mark.parametrize(("question", "left"), [(b"host anew", 0), (b"", 2)])
def test_what_the_status_says_of_the_host_can_begin_anew(question: bytes, left: int) -> None:
    board, executor = board_that_ran()
    server = ControlServer(board, executor)
    board.host.overruns.count = 2
    replies: list[Reply | None] = []
    querier = desktop(board).transport.request("reconros/board0/status")
    querier.get((question,), None, replies.append, 10**9)
    board.environment.run(until=board.environment.now + 1000)
    assert replies[0] is not None
    assert replies[0].payload is not None
    assert msgpack.unpackb(replies[0].payload)["host"]["overruns"] == 2
    assert status(board, executor)["host"]["overruns"] == left
    server.close()


def test_over_the_wire_the_status_is_msgpack() -> None:
    board, executor = board_that_ran()
    server = ControlServer(board, executor)
    replies: list[Reply | None] = []
    querier = desktop(board).transport.request("reconros/board0/status")
    querier.get((b"",), None, replies.append, 10**9)
    board.environment.run(until=board.environment.now + 1000)
    reply, end = replies
    assert end is None
    assert reply is not None
    assert reply.payload is not None
    told, now = msgpack.unpackb(reply.payload), status(board, executor)
    assert now["elapsed_ms"] == told["elapsed_ms"] + 0.001
    assert told == now | {"elapsed_ms": told["elapsed_ms"], "use": told["use"]}
    server.close()
    replies.clear()
    querier.get((b"",), None, replies.append, 10**9)
    board.environment.run(until=board.environment.now + 1000)
    assert replies == [None], "a closed server does not answer"


def claims(transport: SimulatedTransport, name: str) -> bool:
    try:
        claim_name(transport, name)
    except UsageError:
        return False
    return True


def test_a_name_is_taken_until_its_board_has_gone() -> None:
    network = SimulatedNetwork(VirtualEnvironment())
    first, second, third = map(network.transport, "bac")
    assert claims(first, "board0")
    with pytest.raises(
        UsageError, match=r"'board0' is running already\. Stop it, or start this one with --name"
    ):
        claim_name(second, "board0")
    assert claims(third, "board1")
    assert claims(network.transport("d"), "board")
    first.close()
    second.close()
    assert claims(network.transport("e"), "board0")


@pytest.mark.parametrize("sessions", ["ab", "ba"])
def test_of_two_that_claim_a_name_at_once_one_gets_it(sessions: str, monkeypatch: pytest.MonkeyPatch) -> None:
    network = SimulatedNetwork(VirtualEnvironment())
    first, second = map(network.transport, sessions)
    look = first.tokens
    got = []

    def look_late(key: str, timeout_ns: int) -> list[str]:
        got.append(claims(second, "board0"))
        return look(key, timeout_ns)

    monkeypatch.setattr(first, "tokens", look_late)
    got.append(claims(first, "board0"))
    assert sorted(got) == [False, True]


def test_a_board_tells_of_another_that_had_its_name_out_of_sight(caplog: pytest.LogCaptureFixture) -> None:
    environment = VirtualEnvironment()
    network = SimulatedNetwork(environment)
    claim_name(network.transport("a"), "board0")
    claim_name(network.transport("b"), "board1")
    environment.run()
    assert caplog.messages == []
    network.transport("c").declare_token("reconros/board0/owner/c")
    environment.run()
    assert caplog.messages == ["another board is named 'board0', and both answer clients: stop one"]


def test_the_token_of_a_board() -> None:
    assert alive_key("left_arm") == "reconros/left_arm/alive"


class Answering:
    """A transport whose peer answers at once, when it has been found."""

    def __init__(self, reply: Reply | None, running: Iterable[str]) -> None:
        self._reply = reply
        self._running = running
        self.log: list[str] = []

    def request(self, key: str, on_matching: Callable[[bool], None]) -> Answering:
        self.log.append(f"request {key}")
        on_matching(False)
        self.log.append("found")
        on_matching(True)
        return self

    def get(self, parts: Any, attachment: Any, on_reply: Callable[[Reply | None], None], _: int) -> None:
        self.log.append("get")
        if self._reply is not None:
            on_reply(self._reply)
        on_reply(None)

    def close(self) -> None:
        self.log.append("close")

    def tokens(self, key: str, _: int) -> list[str]:
        assert key == alive_key("*")
        return [alive_key(board) for board in self._running]


def ask(reply: Reply | None, monkeypatch: pytest.MonkeyPatch, running: Iterable[str] = ()) -> dict[str, Any]:
    transport = Answering(reply, running)

    class NotingEvent:
        def set(self) -> None:
            transport.log.append("set")

        def wait(self, timeout_s: float) -> None:
            transport.log.append(f"wait {timeout_s} s")

    monkeypatch.setattr(control, "Event", NotingEvent)
    try:
        return ask_status(transport, "board0")  # type: ignore[arg-type] # all of a transport that it needs
    finally:
        # A session that is just open has to hear of the board first.
        assert transport.log == [
            "request reconros/board0/status",
            "found",
            "set",
            "wait 2.0 s",
            "get",
            "close",
        ]


def packed(content: object) -> Reply:
    return Reply(memoryview(msgpack.packb(content)), None, None)


def test_the_status_of_a_board_that_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    told = status(*board_that_ran())
    assert ask(packed(told), monkeypatch) == told


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"\x91" * 10_000,
        b"\xdd\xff\xff\xff\xff",
        b"\x81\x90\x01",
        msgpack.packb([1]),
        msgpack.packb({"version": 1}),
        msgpack.packb({name: told for name, told in status(*board_that_ran()).items() if name != "use"}),
        msgpack.packb({**status(*board_that_ran()), "slots": {}}),
        msgpack.packb({**status(*board_that_ran()), "rejected": {"a": "b"}}),
        msgpack.packb({**status(*board_that_ran()), "elapsed_ms": "1"}),
        msgpack.packb({**status(*board_that_ran()), "elapsed_ms": float("nan")}),
        msgpack.packb({**status(*board_that_ran()), "profile": "\x1b]0;mine\x07"}),
        msgpack.packb({**status(*board_that_ran()), "rejected": {"\x1b[2J": 1}}),
        msgpack.packb({**status(*board_that_ran()), "more": bytes(10_000_000)}),
    ],
    ids=range(14),
)
def test_what_is_no_status_is_said_to_be_none(answer: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        TransportError, match=r"board 'board0' answers with what is no status .* of which version of reconros"
    ):
        ask(Reply(memoryview(answer), None, None), monkeypatch)


@pytest.mark.parametrize("reply", [None, Reply(None, None, "no")], ids=["silence", "error"])
def test_a_board_that_does_not_answer(reply: Reply | None, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        TransportError, match=r"no board named 'board0' answers\..*reconros board --name board0`\.$"
    ):
        ask(reply, monkeypatch)


@pytest.mark.parametrize(
    ("running", "says"),
    [
        (["a", "b"], "no board named 'board0' answers. .*, or name one that runs: a, b.$"),
        (["a", "board0"], "board 'board0' is running but does not answer"),
    ],
)
def test_a_board_that_does_not_answer_is_not_taken_for_one_that_is_not_there(
    running: list[str], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(TransportError, match=f"^{says}"):
        ask(None, monkeypatch, running)


def test_a_board_of_another_version(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(TransportError, match=r"'board0' speaks version 2 of the status, not 1\. Ask"):
        ask(packed({"version": 2}), monkeypatch)


@pytest.mark.parametrize("name", ["", "a/b", "*", "a b", "router"])
def test_what_cannot_name_a_board_is_not_asked(name: str) -> None:
    with pytest.raises(UsageError, match="cannot name a board"):
        ask_status(SimulatedNetwork(VirtualEnvironment()).transport("a1"), name)


def test_nobody_answers_in_an_empty_network() -> None:
    """What `ask_status` builds on: a request without a server is over at once."""
    board, _ = board_that_ran()
    network = SimulatedNetwork(board.environment)
    replies: list[Reply | None] = []
    network.transport("a0").request("reconros/board0/status").get((b"",), None, replies.append, 10**9)
    board.environment.run(until=board.environment.now + 1)
    assert replies == [None]
