"""pyzeros and its ros2_pyterfaces, which share no code with this project, give the same names and bytes.

Of ros2_pyterfaces only the `cyclone` types are used: they are pure Python, the `cydr` ones need a compiler.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import pyzeros.node
import pyzeros.pub
import pyzeros.qos
import pyzeros.service_common
import pyzeros.utils
from hypothesis import given
from hypothesis import strategies as st
from ros2_pyterfaces.cyclone.geometry_msgs import msg as geometry_msgs
from ros2_pyterfaces.cyclone.nav_msgs import msg as nav_msgs
from ros2_pyterfaces.cyclone.sensor_msgs import msg as sensor_msgs
from ros2_pyterfaces.cyclone.std_msgs import msg as std_msgs
from ros2_pyterfaces.cyclone.std_srvs import srv as std_srvs

from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, NodeToken, gid, parse
from reconros_zenoh.ros.names import data_key, dds_type_name, resolve
from reconros_zenoh.ros.qos import Durability, History, Liveliness, QosProfile, Reliability
from reconros_zenoh.ros.type_registry import TypeRegistry

REGISTRY = TypeRegistry()
SESSION: Any = object()  # not looked at, because every id is given
IDS: dict[str, Any] = {
    "domain_id": 5,
    "_zenoh_id": "59924250ed2b093ddd37ec37db7a561",
    "_node_id": 3,
    "_entity_id": 8,
}
DDS_STRING = "std_msgs::msg::dds_::String_"
STRING_HASH = REGISTRY.message("std_msgs/String").type_hash

QOS = [
    (QosProfile(), pyzeros.qos.QosProfile()),
    (QosProfile(depth=42), pyzeros.qos.QosProfile(depth=42)),
    (
        QosProfile(Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL, depth=1),
        pyzeros.qos.QosProfile(reliability="best_effort", durability="transient_local", depth=1),
    ),
    (
        QosProfile(history=History.KEEP_ALL, depth=42),
        pyzeros.qos.QosProfile(history="keep_all", depth=42),
    ),
    (
        QosProfile(deadline_ns=100_000_000, lifespan_ns=2_500_000_000, lease_ns=1_000_000_007),
        pyzeros.qos.QosProfile(deadline=0.1, lifespan=2.5, liveliness_lease_duration=(1, 7)),
    ),
    (
        QosProfile(liveliness=Liveliness.MANUAL_BY_TOPIC),
        pyzeros.qos.QosProfile(liveliness="manual_by_topic"),
    ),
]


@pytest.mark.parametrize(("ours", "theirs"), QOS)
def test_qos(ours: QosProfile, theirs: Any) -> None:
    assert ours.encode() == theirs.encode()


@pytest.mark.parametrize(("ours", "theirs"), QOS)
@pytest.mark.parametrize(("namespace", "topic"), [("/", "chatter"), ("/lab/b1", "chatter"), ("/lab", "/a/b")])
def test_topic_key_token_and_gid(ours: QosProfile, theirs: Any, namespace: str, topic: str) -> None:
    name = resolve(topic, namespace, "pz")
    assert data_key(5, name, DDS_STRING, STRING_HASH) == pyzeros.pub.publisher_keyexpr(
        topic, DDS_STRING, STRING_HASH, namespace, domain_id=5
    )
    token = EndpointToken(
        5,
        IDS["_zenoh_id"],
        "3",
        "8",
        EndpointKind.PUBLISHER,
        namespace,
        "pz",
        name,
        DDS_STRING,
        STRING_HASH,
        ours,
    )
    key = pyzeros.pub.token_keyexpr(
        topic, DDS_STRING, STRING_HASH, theirs, "pz", session=SESSION, namespace=namespace, **IDS
    )
    assert token.format() == key
    assert parse(key) == token
    assert gid(key) == pyzeros.utils.rmw_zenoh_gid(key)


@pytest.mark.parametrize("kind", [EndpointKind.SERVICE, EndpointKind.CLIENT])
def test_service_token(kind: EndpointKind) -> None:
    service = REGISTRY.service("std_srvs/SetBool")
    token = EndpointToken(
        5,
        IDS["_zenoh_id"],
        "3",
        "8",
        kind,
        "/lab",
        "pz",
        "/lab/lamp",
        service.dds_name,
        service.type_hash,
        QosProfile(),
    )
    code: Any = kind.value
    key = pyzeros.service_common.token_keyexpr(
        code,
        "/lab/lamp",
        pyzeros.utils.ros_type_to_dds_type("std_srvs/srv/SetBool"),
        std_srvs.SetBool.hash_rihs01(),
        node_name="pz",
        session=SESSION,
        namespace="/lab",
        **IDS,
    )
    assert token.format() == key
    assert parse(key) == token


@pytest.mark.parametrize("namespace", ["/", "/lab/b1"])
def test_node_token(namespace: str) -> None:
    key = pyzeros.node.token_keyexpr("pz", session=SESSION, namespace=namespace, **IDS)
    token = NodeToken(5, IDS["_zenoh_id"], "3", "8", namespace, "pz")
    assert token.format() == key
    assert parse(key) == token


@pytest.mark.parametrize("namespace", ["/", "/lab", "/lab/b1"])
@pytest.mark.parametrize("name", ["sort", "/sort", "a/sort", "~/sort", "~"])
def test_name_resolution(name: str, namespace: str) -> None:
    theirs = pyzeros.service_common.qualify_service_name(name, namespace, "node")
    assert resolve(name, namespace, "node") == theirs


@given(st.text())
def test_gid_of_any_text(text: str) -> None:
    assert gid(text) == pyzeros.utils.rmw_zenoh_gid(text)


MESSAGES = [
    theirs
    for package in (std_msgs, geometry_msgs, nav_msgs, sensor_msgs)
    for name, theirs in vars(package).items()
    if isinstance(theirs, type)
    and theirs.__module__ == package.__name__
    and not name.startswith("_")
    # These differ between Jazzy and the newest release, which ros2_pyterfaces has.
    and name not in {"Goals", "Range", "Trajectory", "TrajectoryPoint"}
]


def test_there_are_messages_to_compare() -> None:
    assert {std_msgs.UInt32MultiArray, sensor_msgs.Image, sensor_msgs.PointCloud2} <= set(MESSAGES)


@pytest.mark.parametrize("theirs", MESSAGES, ids=lambda theirs: theirs.__name__)
def test_message_name_and_hash(theirs: Any) -> None:
    ours = REGISTRY.message(theirs.get_type_name())
    assert ours.type_hash == theirs.hash_rihs01()
    assert ours.dds_name == dds_type_name(ours.name) == pyzeros.utils.ros_type_to_dds_type(ours.name)


@pytest.mark.parametrize(
    "theirs", [std_srvs.Empty, std_srvs.SetBool, std_srvs.Trigger], ids=lambda theirs: theirs.__name__
)
def test_service_name_and_hash(theirs: Any) -> None:
    ours = REGISTRY.service(theirs.get_type_name())
    assert ours.type_hash == theirs.hash_rihs01()
    assert ours.request.type_hash == theirs.Request.hash_rihs01()
    assert ours.response.type_hash == theirs.Response.hash_rihs01()


@pytest.mark.parametrize("theirs", MESSAGES, ids=lambda theirs: theirs.__name__)
def test_default_messages_have_the_same_bytes(theirs: Any) -> None:
    payload = theirs().serialize()
    kind = REGISTRY.message(theirs.get_type_name())
    assert b"".join(kind.encode(kind.decode(payload))) == payload


@pytest.mark.parametrize("count", [0, 1, 7, 100_000])
def test_messages_with_arrays_and_strings_have_the_same_bytes(count: int) -> None:
    data: Any = np.arange(count).astype(np.uint8).tolist()
    theirs = sensor_msgs.Image(height=1, width=count, encoding="mono8", data=data)
    theirs.header.frame_id = "kamera ä"
    payload = theirs.serialize()
    kind = REGISTRY.message("sensor_msgs/Image")
    message = kind.decode(payload)
    assert (message.width, message.encoding, message.header.frame_id) == (count, "mono8", "kamera ä")
    assert np.array_equal(message.data, data)
    assert b"".join(kind.encode(message)) == payload


@pytest.mark.parametrize("count", [0, 1, 2, 9])
def test_arrays_of_eight_byte_numbers_have_the_same_bytes(count: int) -> None:
    names: Any = ["j" * i for i in range(count)]
    positions: Any = [0.5 * i for i in range(count)]
    payload = sensor_msgs.JointState(name=names, position=positions).serialize()
    kind = REGISTRY.message("sensor_msgs/JointState")
    message = kind.decode(payload)
    assert message.position.tolist() == positions
    assert b"".join(kind.encode(message)) == payload


def test_nested_arrays_have_the_same_bytes() -> None:
    dimensions: Any = [std_msgs.MultiArrayDimension(label="x" * i, size=i, stride=1) for i in range(4)]
    layout = std_msgs.MultiArrayLayout(dim=dimensions, data_offset=3)
    data: Any = list(range(20_000))
    payload = std_msgs.UInt32MultiArray(layout=layout, data=data).serialize()
    kind = REGISTRY.message("std_msgs/UInt32MultiArray")
    message = kind.decode(payload)
    assert [dimension.label for dimension in message.layout.dim] == ["", "x", "xx", "xxx"]
    parts = kind.encode(message)
    assert len(parts) == 2
    assert b"".join(parts) == payload
