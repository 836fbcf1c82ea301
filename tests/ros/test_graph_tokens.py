"""Liveliness tokens of nodes and endpoints."""

from __future__ import annotations

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, NodeToken, gid, parse, tokens_expression
from reconros_zenoh.ros.qos import QosProfile

ZID = "59924250ed2b093ddd37ec37db7a561"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
STRING_PUBLISHER = (
    f"@ros2_lv/0/{ZID}/0/1/MP/%/%/pz/%chatter/std_msgs::msg::dds_::String_/{STRING_HASH}/::,10:,:,:,,"
)
STRING_TOKEN = EndpointToken(
    domain=0,
    zid=ZID,
    nid="0",
    id="1",
    kind=EndpointKind.PUBLISHER,
    namespace="/",
    node="pz",
    name="/chatter",
    dds_type="std_msgs::msg::dds_::String_",
    type_hash=STRING_HASH,
    qos=QosProfile(),
)

word = st.text(alphabet=string.ascii_letters + string.digits + "_", min_size=1, max_size=8)
absolute = st.lists(word, max_size=3).map(lambda words: "/" + "/".join(words))
profiles = st.builds(QosProfile, depth=st.integers(1, 100))
nodes = st.builds(NodeToken, st.integers(0, 232), word, word, word, absolute, word, absolute)
endpoints = st.builds(
    EndpointToken,
    st.integers(0, 232),
    word,
    word,
    word,
    st.sampled_from(EndpointKind),
    absolute,
    word,
    absolute,
    word.map("pkg::msg::dds_::{}_".format),
    word.map("RIHS01_{}".format) | st.just("TypeHashNotSupported"),
    profiles,
    absolute,
    st.sampled_from(["", "backends:cpu:"]),
)


def test_golden_endpoint() -> None:
    assert STRING_TOKEN.format() == STRING_PUBLISHER
    assert parse(STRING_PUBLISHER) == STRING_TOKEN


def test_golden_gid() -> None:
    assert gid(STRING_PUBLISHER).hex() == "7c09e8f22895b58a7d36790c0281fe0c"


def test_node_in_a_namespace() -> None:
    token = NodeToken(3, ZID, "4", "4", "/lab/board", "inverse")
    assert token.format() == f"@ros2_lv/3/{ZID}/4/4/NN/%/%lab%board/inverse"
    assert parse(token.format()) == token


def test_the_empty_enclave_is_the_root() -> None:
    assert NodeToken(0, ZID, "0", "0", "/", "n", enclave="").format() == f"@ros2_lv/0/{ZID}/0/0/NN/%/%/n"


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        (EndpointKind.PUBLISHER, "MP"),
        (EndpointKind.SUBSCRIPTION, "MS"),
        (EndpointKind.SERVICE, "SS"),
        (EndpointKind.CLIENT, "SC"),
    ],
)
def test_kinds(kind: EndpointKind, code: str) -> None:
    token = parse(STRING_PUBLISHER.replace("/MP/", f"/{code}/"))
    assert isinstance(token, EndpointToken)
    assert token.kind is kind


def test_tokens_of_other_releases() -> None:
    lyrical = parse(STRING_PUBLISHER + "/backends:cpu:")
    assert isinstance(lyrical, EndpointToken)
    assert lyrical.backends == "backends:cpu:"
    assert lyrical.format() == STRING_PUBLISHER + "/backends:cpu:"
    humble = parse(STRING_PUBLISHER.replace(STRING_HASH, "TypeHashNotSupported"))
    assert isinstance(humble, EndpointToken)
    assert humble.type_hash == "TypeHashNotSupported"


@given(nodes | endpoints)
def test_round_trip(token: NodeToken | EndpointToken) -> None:
    assert parse(token.format()) == token


@pytest.mark.parametrize(
    "key",
    [
        "",
        "@ros2_lv",
        "@ros2_lv/0/**",
        f"@ros2_lv/0/{ZID}/0/0/NN/%/%",  # no node name
        f"@ros2_lv/0/{ZID}/0/0/NN/%/%/node/more",
        f"@ros2_lv/0/{ZID}/0/0/NN/%//node",  # an empty part
        f"@ros2_lv/zero/{ZID}/0/0/NN/%/%/node",
        f"@ros2_lv/-1/{ZID}/0/0/NN/%/%/node",
        f"@ros2_lv/٣/{ZID}/0/0/NN/%/%/node",
        f"@ros2_lv/{'1' * 5000}/{ZID}/0/0/NN/%/%/node",
        f"@ros2_lw/0/{ZID}/0/0/NN/%/%/node",
        f"@ros2_lv/0/{ZID}/0/0/MP/%/%/node",
        STRING_PUBLISHER.replace("/MP/", "/XX/"),
        STRING_PUBLISHER.removesuffix("/::,10:,:,:,,"),
        STRING_PUBLISHER.replace("::,10:", "::,ten:"),
        STRING_PUBLISHER + "/more",
        STRING_PUBLISHER.replace("chatter", "\x1b]0;mine\x07"),
        STRING_PUBLISHER + "/backends:cpu:/more",
        "0/chatter/std_msgs::msg::dds_::String_/" + STRING_HASH,
    ],
)
def test_what_is_no_token(key: str) -> None:
    assert parse(key) is None


pieces = st.sampled_from(STRING_PUBLISHER.split("/")) | st.text(max_size=4)


@given(st.text() | st.lists(pieces, max_size=15).map("/".join))
def test_no_key_makes_parse_raise(key: str) -> None:
    token = parse(key)
    assert token is None or parse(token.format()) == token


def test_tokens_expression() -> None:
    assert tokens_expression(7) == "@ros2_lv/7/**"
