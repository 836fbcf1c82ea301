"""Gateways declared on a running board over its control queryable, in virtual time."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest
from small_board import desktop, small_board, small_profile, types

from reconros_zenoh.board.control import VERSION, gateways
from reconros_zenoh.board.gateway_control import GatewayServer, check_type
from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.qos import QosProfile

ADD = {"name": "bridge", "hmt": "/a", "smt": "/a", "type": "std_msgs/msg/UInt32"}


class Running:
    def __init__(self) -> None:
        self.board = small_board(small_profile(topics={}))
        self.board.hardware_topic("/c", types().message("std_msgs/msg/UInt32"))
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
    assert running.ask(request()) == {"version": VERSION, "gateways": [], "refused": None}
    answer = running.ask(request(**ADD))
    assert answer == {"version": VERSION, "gateways": gateways(running.board), "refused": None}
    assert answer["gateways"][0]["hmt"] == "hmt/board0/a"
    assert running.ask(request()) == answer


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
        (request(**{**ADD, "hmt": "/c", "smt": "/c", "type": "std_msgs/msg/String"}), "has the type"),
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
    ],
)
def test_what_cannot_be_added_is_refused_and_changes_nothing(question: bytes, words: str) -> None:
    running = Running()
    before = running.ask(request(**ADD))
    topics = list(running.board.hardware_topics)
    assert words in running.ask(question)["refused"]
    assert running.ask(request()) == before
    assert list(running.board.hardware_topics) == topics


def test_a_closed_server_does_not_answer() -> None:
    running = Running()
    running.server.close()
    assert running.ask(request()) is None


def test_a_topic_that_is_there_with_another_type_is_refused() -> None:
    running = Running()
    running.board.context.node("n").publisher(types().message("std_msgs/msg/UInt32"), "/a")
    check_type(running.client.transport, 0, "/a", "std_msgs/msg/UInt32")
    check_type(running.client.transport, 0, "/b", "std_msgs/msg/String")
    with pytest.raises(UsageError, match="the topic /a has the type std_msgs::msg::dds_::UInt32_"):
        check_type(running.client.transport, 0, "/a", "std_msgs/msg/String")
