"""Names and the key expressions made of them."""

from __future__ import annotations

import re
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.names import (
    check_namespace,
    check_node_name,
    check_topic_name,
    data_key,
    dds_type_name,
    demangle,
    mangle,
    resolve,
    type_name_of,
)

HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


@pytest.mark.parametrize("topic", ["/chatter", "chatter", "/chatter/"])
def test_data_key(topic: str) -> None:
    key = data_key(0, topic, "std_msgs::msg::dds_::String_", HASH)
    assert key == f"0/chatter/std_msgs::msg::dds_::String_/{HASH}"


def test_data_key_keeps_inner_slashes() -> None:
    assert data_key(7, "/front/camera/image_raw", "T", "H") == "7/front/camera/image_raw/T/H"


@pytest.mark.parametrize(
    ("name", "dds_name"),
    [
        ("sensor_msgs/msg/Image", "sensor_msgs::msg::dds_::Image_"),
        ("sorter_msgs/srv/Sort", "sorter_msgs::srv::dds_::Sort_"),
        ("sorter_msgs/srv/Sort_Request", "sorter_msgs::srv::dds_::Sort_Request_"),
    ],
)
def test_dds_type_name(name: str, dds_name: str) -> None:
    assert dds_type_name(name) == dds_name
    assert type_name_of(dds_name) == name


@pytest.mark.parametrize(
    ("name", "part"), [("/", "%"), ("/chatter", "%chatter"), ("/a/b", "%a%b"), ("node", "node")]
)
def test_mangle(name: str, part: str) -> None:
    assert mangle(name) == part
    assert demangle(part) == name


def test_the_empty_enclave_is_mangled_as_the_root() -> None:
    assert mangle("") == "%"


@given(st.text(alphabet=string.ascii_letters + string.digits + "_/", min_size=1))
def test_mangled_names_come_back_and_are_one_part_of_a_key(name: str) -> None:
    assert "/" not in mangle(name)
    assert demangle(mangle(name)) == name


@pytest.mark.parametrize(
    ("name", "namespace", "node", "absolute"),
    [
        ("/angle", "/", "inverse", "/angle"),
        ("/angle", "/board", "inverse", "/angle"),
        ("angle", "/", "inverse", "/angle"),
        ("angle", "/board", "inverse", "/board/angle"),
        ("leg/angle", "/lab/board", "inverse", "/lab/board/leg/angle"),
        ("~", "/", "inverse", "/inverse"),
        ("~", "/board", "inverse", "/board/inverse"),
        ("~/angle", "/", "inverse", "/inverse/angle"),
        ("~/angle", "/board", "inverse", "/board/inverse/angle"),
        ("_hidden", "/", "inverse", "/_hidden"),
    ],
)
def test_resolve(name: str, namespace: str, node: str, absolute: str) -> None:
    assert resolve(name, namespace, node) == absolute


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "is empty"),
        ("/", "ends with '/'"),
        ("~/", "ends with '/'"),
        ("angle/", "ends with '/'"),
        ("/a//b", "contains '//'"),
        ("a b", "contains ' '"),
        ("ä", "contains 'ä'"),
        ("/a/*", "contains '*'"),
        ("a~", "contains '~'"),
        ("~angle", "'~' that is not followed by '/'"),
        ("/leg/0", "begins with a digit, '0'"),
        ("2nd", "begins with a digit, '2nd'"),
        ("a\n", "contains '\\n'"),
        ("/" + 247 * "a", "is longer than 247"),
    ],
)
def test_topic_names_that_are_not_allowed(name: str, reason: str) -> None:
    with pytest.raises(UsageError, match=re.escape(reason)):
        check_topic_name(name)
    with pytest.raises(UsageError, match=re.escape(reason)):
        resolve(name, "/", "node")


def test_a_name_may_become_too_long_by_its_namespace() -> None:
    check_topic_name("a" * 247)
    with pytest.raises(UsageError, match="longer than 247"):
        resolve("a" * 247, "/", "node")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "is empty"),
        ("a/b", "contains '/'"),
        ("a-b", "contains '-'"),
        ("0a", "begins with a digit"),
        ("a" * 256, "is longer than 255"),
    ],
)
def test_node_names_that_are_not_allowed(name: str, reason: str) -> None:
    check_node_name("sort_node_1")
    check_node_name("a" * 255)
    with pytest.raises(UsageError, match=re.escape(reason)):
        check_node_name(name)
    with pytest.raises(UsageError, match=re.escape(reason)):
        resolve("topic", "/", name)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "does not begin with '/'"),
        ("board", "does not begin with '/'"),
        ("/board/", "ends with '/'"),
        ("/a//b", "contains '//'"),
        ("/a/1", "begins with a digit"),
        ("/~", "contains '~'"),
        ("/" + "a" * 245, "is longer than 245"),
    ],
)
def test_namespaces_that_are_not_allowed(name: str, reason: str) -> None:
    check_namespace("/")
    check_namespace("/lab/board_1")
    with pytest.raises(UsageError, match=re.escape(reason)):
        check_namespace(name)
    with pytest.raises(UsageError, match=re.escape(reason)):
        resolve("topic", name, "node")
