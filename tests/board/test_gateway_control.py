"""Gateways declared on a running board over its control queryable, in virtual time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgpack
import pytest
from small_board import (
    BITSTREAM_BYTES,
    Tickets,
    desktop,
    logging_thread,
    small_board,
    small_profile,
    types,
)

from reconros_zenoh.board.answers import VERSION
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.gateway_control import GatewayServer, check_type
from reconros_zenoh.board.hmt import Fifo, FifoPlan, HmtWriter
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.status import gateways
from reconros_zenoh.errors import UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Container

ADD = {"name": "bridge", "hmt": "/a", "smt": "/a", "type": "std_msgs/msg/UInt32"}


class Running:
    def __init__(self, slots: int = 2, static: Container[int] = ()) -> None:
        profile = small_profile({"a": (0, 100)}, topics={})
        self.board = small_board(profile, slots, static=static)
        HmtWriter(self.board.hardware_topic("/c", types().message("std_msgs/msg/UInt32")))
        self.server = GatewayServer(self.board, types())
        self.client = desktop(self.board)
        self.querier = self.client.transport.request(f"reconros/{self.board.name}/gateway")
        self.board.environment.run()

    def ask(self, question: bytes) -> Any:
        replies: list[Any] = []
        self.querier.get((question,), None, replies.append, 1000)
        self.board.environment.run()
        assert replies[-1] is None
        reply = replies[0] if len(replies) > 1 else None
        return reply and msgpack.unpackb(reply.payload)


def request(**add: object) -> bytes:
    packed: bytes = msgpack.packb({"version": VERSION, **({"add": add} if add else {})})
    return packed


def test_a_gateway_is_added_and_listed() -> None:
    running = Running()
    none = {"version": VERSION, "gateways": [], "refused": None, "warning": None}
    assert running.ask(request()) == none
    answer = running.ask(request(**{**ADD, "hmt": "/c", "smt": "/c"}))
    assert answer == none | {"gateways": gateways(running.board)}
    assert answer["gateways"][0]["hmt"] == "hmt/board0/c"
    assert running.ask(request()) == answer


def test_a_stream_that_no_callback_has_is_warned_of() -> None:
    running = Running()
    nobody = "no callback of board 'board0' has a hardware-mapped end of {}. Its streams: /c."
    for topic in "ab":
        answer = running.ask(request(**{**ADD, "name": topic, "hmt": f"/{topic}", "smt": f"/{topic}"}))
        assert (answer["refused"], answer["warning"]) == (None, nobody.format(f"/{topic}"))
    answer = running.ask(request(**{**ADD, "hmt": "/typo", "smt": "/typo"}))
    assert answer["refused"].startswith("board 'board0' has no slot for a gateway: ")
    assert answer["refused"].endswith(f" Besides, {nobody.format('/typo')}")
    assert not running.ask(request(**{**ADD, "hmt": "/c"}))["refused"].endswith("/c.")


def test_a_gateway_is_added_with_its_qos() -> None:
    running = Running()
    (added,) = running.ask(request(**ADD, qos={"reliability": "best_effort", "depth": 1}))["gateways"]
    assert added["qos"] == {**QosProfile().words(), "reliability": "best_effort", "depth": 1}


@pytest.mark.parametrize(
    ("question", "words"),
    [
        (request(**ADD), "has a gateway on board 'board0' already"),
        (
            request(**{**ADD, "hmt": "/b", "smt": "/b", "type": "std_msgs/msg/Nothing"}),
            "std_msgs/msg/Nothing",
        ),
        (request(**{**ADD, "hmt": "/c", "smt": "/c"}), "has a gateway 'bridge' already. Give another name."),
        (request(name="c", hmt="/c", smt="/c", type="std_msgs/msg/String"), "has the type"),
        (msgpack.packb({"version": VERSION + 1}), f"speaks version {VERSION}"),
        (request(**{**ADD, "hmt": "/b"}), "/a has a gateway on board 'board0' already"),
        (request(**{**ADD, "hmt": "/b*", "smt": "/b"}), "'/b*' contains '*'"),
        (request(**{**ADD, "hmt": "/b", "smt": "b c"}), "'b c' contains ' '"),
        (request(**{**ADD, "hmt": "/b", "smt": "/b", "name": "a b"}), "The node name 'a b'"),
        (request(name="x"), "no request: Field required"),
        (request(**{**ADD, "hmt": "/b", "smt": "/b", "qos": {"depth": 0}}), "depth is 0. Write a number"),
        (request(**{**ADD, "hmt": "/b", "smt": "/b", "qos": {"speed": 1}}), "no QoS policy 'speed'"),
        (request(**{**ADD, "hmt": "/b", "smt": "/b", "qos": {"depth": 1.5}}), "no request: Input should"),
        (request(**{**ADD, "hmt": "/b", "smt": "/b", "qos": 5}), "no request: Input should be a valid dict"),
        *(
            (request(**{**ADD, "hmt": "/b", "smt": "/b", key: 5}), "no request: Input should be a valid str")
            for key in ADD
        ),
        (msgpack.packb({"version": VERSION, "add": 5}), "no request"),
        (msgpack.packb(5), "no request"),
        (b"\xc1", "no request"),
        (bytes(10_001), "no request: it has 10001 bytes"),
    ],
)
def test_what_cannot_be_added_is_refused_and_changes_nothing(question: bytes, words: str) -> None:
    running = Running()
    before = running.ask(request(**ADD))
    topics = list(running.board.hardware_topics)
    assert words in running.ask(question)["refused"]
    assert running.ask(request()) == before | {"warning": None}
    assert list(running.board.hardware_topics) == topics


def test_each_takes_a_slot_and_without_one_it_is_refused() -> None:
    running = Running()
    for number, topic in enumerate("ab"):
        wanted = {**ADD, "name": topic, "hmt": f"/{topic}", "smt": f"/{topic}"}
        assert not running.ask(request(**wanted))["refused"]
        assert gateways(running.board)[-1]["slot"] == number
    assert [slot.holds and slot.holds.callback for slot in running.board.slots.values()] == ["a", "b"]
    refused = running.ask(request(**{**ADD, "hmt": "/d", "smt": "/d"}))["refused"]
    assert refused.startswith("board 'board0' has no slot for a gateway: ")
    assert len(gateways(running.board)) == 2


def test_neither_a_slot_of_a_callback_nor_one_that_cannot_be_loaded_is_free() -> None:
    running = Running(slots=3, static=[0])
    executor = Executor(running.board, 0, 3)
    executor.add_hw_callback("a", [1], CallbackKind.SUB, Tickets(running.board), logging_thread([], "a"))
    assert not running.ask(request(**ADD))["refused"]
    assert gateways(running.board)[0]["slot"] == 2
    with pytest.raises(UsageError, match="'a' cannot be in slot 2, which is for bridge"):
        executor.add_hw_callback("a", [2], CallbackKind.SUB, Tickets(running.board), logging_thread([], "a"))


def test_its_bitstream_is_written_and_what_comes_meanwhile_waits() -> None:
    running = Running()
    board, word = running.board, types().message("std_msgs/msg/UInt32")
    running.ask(request(**ADD, qos={"depth": 5}))
    assert board.slots[0].reconfigurations == 1
    heard: list[tuple[int, int]] = []

    def note() -> None:
        heard.append((board.environment.now, fifo.take().message.data))

    fifo = Fifo(FifoPlan(), note, None, cut_through=False)
    board.hardware_topic("/d", word).subscribe(fifo)
    server = GatewayServer(board, types())
    started_ns = board.environment.now
    server._add(memoryview(request(**{**ADD, "name": "d", "hmt": "/d", "smt": "/d"})))
    writer = board.writer(board.context.node("n"), word, "/d")
    for number in range(3):
        writer.send(writer.encode(word.cls(data=number)), Timeline(board.environment, started_ns))
    board.environment.run()
    assert [number for _, number in heard] == [0, 1, 2]
    assert min(time_ns for time_ns, _ in heard) >= started_ns + BITSTREAM_BYTES // 2


def test_a_closed_server_does_not_answer() -> None:
    running = Running()
    running.server.close()
    assert running.ask(request()) is None


def test_a_topic_that_is_there_with_another_type_is_refused() -> None:
    running = Running()
    running.board.context.node("n").publisher(types().message("std_msgs/msg/UInt32"), "/a")
    check_type(running.client.transport, 0, "/a", "std_msgs/msg/UInt32")
    check_type(running.client.transport, 0, "/b", "std_msgs/msg/String")
    with pytest.raises(UsageError, match="/a has the type std_msgs/msg/UInt32, not std_msgs/msg/String"):
        check_type(running.client.transport, 0, "/a", "std_msgs/msg/String")


def test_a_service_of_the_name_of_the_topic_is_none_of_its_ends() -> None:
    running = Running()
    node, flip = running.board.context.node("n"), types().service("std_srvs/srv/SetBool")
    node.service(flip, "/a", lambda request: None)
    check_type(running.client.transport, 0, "/a", "std_msgs/msg/UInt32")
