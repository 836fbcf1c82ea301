"""The ROS graph: tokens come with nodes and endpoints, and go with them."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import pytest
from two_sessions import TwoSessions, types

from reconros_zenoh.errors import UsageError
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, NodeToken, parse
from reconros_zenoh.ros.qos import Durability, QosProfile

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture
def sessions() -> TwoSessions:
    return TwoSessions()


def test_a_node_appears_and_disappears(sessions: TwoSessions) -> None:
    node = sessions.here.node("talker", "/lab")
    assert [parse(token) for token in sessions.tokens()] == [NodeToken(0, "a1", "0", "0", "/lab", "talker")]
    node.close()
    node.close()
    assert sessions.tokens() == []


def test_every_endpoint_appears_with_its_name_type_and_qos(sessions: TwoSessions) -> None:
    node = sessions.here.node("all", "/lab")
    word, set_bool = types().message("std_msgs/msg/UInt32"), types().service("std_srvs/srv/SetBool")
    latched = QosProfile(durability=Durability.TRANSIENT_LOCAL, depth=1)
    node.publisher(word, "out", latched)
    node.subscription(word, "/in", lambda _: None)
    node.service(set_bool, "~/switch", lambda _: None)
    node.client(set_bool, "other")
    expected: set[tuple[EndpointKind, str, str, Any, QosProfile]] = {
        (EndpointKind.PUBLISHER, "1", "/lab/out", word, latched),
        (EndpointKind.SUBSCRIPTION, "2", "/in", word, QosProfile()),
        (EndpointKind.SERVICE, "3", "/lab/all/switch", set_bool, QosProfile()),
        (EndpointKind.CLIENT, "4", "/lab/other", set_bool, QosProfile()),
    }
    endpoints = {parse(token) for token in sessions.tokens()} - {NodeToken(0, "a1", "0", "0", "/lab", "all")}
    assert endpoints == {
        EndpointToken(
            0, "a1", "0", number, kind, "/lab", "all", name, interface.dds_name, interface.type_hash, qos
        )
        for kind, number, name, interface, qos in expected
    }


def test_a_node_forgets_an_endpoint_that_is_closed(sessions: TwoSessions) -> None:
    node = sessions.here.node("brief")
    word, set_bool = types().message("std_msgs/msg/UInt32"), types().service("std_srvs/srv/SetBool")
    lasting = node.publisher(word, "out")
    brief = (
        node.publisher(word, "out"),
        node.subscription(word, "/in", lambda _: None),
        node.service(set_bool, "~/switch", lambda _: None),
        node.client(set_bool, "other"),
    )
    assert list(node.endpoints) == [lasting, *brief]
    for endpoint in brief:
        endpoint.close()
    assert list(node.endpoints) == [lasting]
    node.close()
    assert not node.endpoints
    assert sessions.tokens() == []


def test_ids_count_on_over_the_nodes_of_a_session(sessions: TwoSessions) -> None:
    word = types().message("std_msgs/msg/UInt32")
    for name in ("first", "second"):
        sessions.here.node(name).publisher(word, "out")
    sessions.there.node("elsewhere")
    tokens = [parse(token) for token in sessions.tokens()]
    assert sorted((token.zid, token.nid, token.id) for token in tokens if token) == [
        ("a1", "0", "0"),
        ("a1", "0", "1"),
        ("a1", "2", "2"),
        ("a1", "2", "3"),
        ("b2", "0", "0"),
    ]


@pytest.mark.parametrize("kind", ["publisher", "subscription", "service", "client"])
def test_an_endpoint_disappears_when_it_is_closed_and_its_node_stays(
    sessions: TwoSessions, kind: str
) -> None:
    node = sessions.here.node("node")
    word, set_bool = types().message("std_msgs/msg/UInt32"), types().service("std_srvs/srv/SetBool")
    open_endpoint: dict[str, Callable[[], Any]] = {
        "publisher": lambda: node.publisher(word, "a"),
        "subscription": lambda: node.subscription(word, "a", lambda _: None),
        "service": lambda: node.service(set_bool, "a", lambda _: None),
        "client": lambda: node.client(set_bool, "a"),
    }
    endpoint = open_endpoint[kind]()
    assert len(sessions.tokens()) == 2
    endpoint.close()
    assert sessions.tokens() == ["@ros2_lv/0/a1/0/0/NN/%/%/node"]
    node.close()
    assert sessions.tokens() == []


def test_an_endpoint_disappears_with_its_node(sessions: TwoSessions) -> None:
    word, set_bool = types().message("std_msgs/msg/UInt32"), types().service("std_srvs/srv/SetBool")
    node = sessions.here.node("node")
    node.publisher(word, "a")
    node.subscription(word, "a", lambda _: None)
    node.service(set_bool, "b", lambda _: None)
    node.client(set_bool, "b")
    assert len(sessions.tokens()) == 5
    node.close()
    assert sessions.tokens() == []


def test_changes_of_the_graph_can_be_watched(sessions: TwoSessions) -> None:
    changes: list[tuple[str, bool]] = []
    sessions.there.transport.watch_tokens(
        "@ros2_lv/0/**", lambda token, alive: changes.append((token, alive))
    )
    node = sessions.here.node("talker")
    sessions.settle()
    node.close()
    sessions.settle()
    token = "@ros2_lv/0/a1/0/0/NN/%/%/talker"
    assert changes == [(token, True), (token, False)]


def test_the_domain_stands_in_token_and_key() -> None:
    sessions = TwoSessions(domain_here=7)
    publisher = sessions.here.node("talker").publisher(types().message("std_msgs/msg/UInt32"), "out")
    assert publisher.key.startswith("7/out/")
    assert all(token.startswith("@ros2_lv/7/a1/") for token in sessions.tokens())


def test_a_context_is_in_domain_0_and_on_the_clock_of_the_host_unless_told_otherwise(
    sessions: TwoSessions,
) -> None:
    context = Context(sessions.network.transport("e5"))
    assert context.domain == 0
    assert context.clock_ns is time.time_ns


@pytest.mark.parametrize(
    ("name", "namespace", "said"),
    [
        ("left arm", "/", "node name 'left arm'"),
        ("node", "lab", "namespace name 'lab'"),
        ("", "/", "is empty"),
    ],
)
def test_a_name_that_ros_2_does_not_allow(
    sessions: TwoSessions, name: str, namespace: str, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        sessions.here.node(name, namespace)
    assert sessions.tokens() == []


def test_a_topic_name_that_ros_2_does_not_allow(sessions: TwoSessions) -> None:
    node = sessions.here.node("node")
    with pytest.raises(UsageError, match="topic or service name 'left arm'"):
        node.publisher(types().message("std_msgs/msg/UInt32"), "left arm")
    assert len(sessions.tokens()) == 1
