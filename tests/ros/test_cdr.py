"""Messages as CDR bytes: the same as rosbags makes, in parts, and safe to read from anyone."""

from __future__ import annotations

import tracemalloc
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
import pytest
from cdr_cases import (
    IMAGE,
    REGISTRY,
    SORT,
    STRING,
    TYPES,
    filled,
    image,
    properties,
    rosbags_bytes,
    typed_messages,
)
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.ros import types
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from reconros_zenoh.ros.types import MessageType

END_IN_AN_ARRAY = {
    "std_msgs/msg/UInt32MultiArray",
    "std_msgs/msg/ByteMultiArray",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/Imu",
    "sorter_msgs/srv/Sort_Request",
    "lab_msgs/msg/Bools",
    "lab_msgs/msg/Shorts",
    "lab_msgs/msg/Bounded",
    "lab_msgs/msg/Wide",
    "lab_msgs/msg/Keyword",
}
HELLO = bytes.fromhex("000100000800000068656c6c6f203000")


def refused(kind: MessageType, payload: bytes | memoryview) -> BadMessageError:
    with pytest.raises(BadMessageError) as caught:
        kind.decode(payload)
    return caught.value


OUTCOMES = {"message", "truncated", "foreign_encoding"}


def outcome(kind: MessageType, payload: bytes) -> str:
    try:
        message = kind.decode(payload)
    except BadMessageError as error:
        return error.reason
    return "message" if type(message) is kind.cls else "something else"


def test_golden_bytes() -> None:
    assert STRING.encode(STRING.cls("hello 0")) == (HELLO,)
    assert STRING.decode(HELLO).data == "hello 0"


def test_golden_bytes_of_a_sort_request() -> None:
    message = SORT.cls(np.array([3, 1, 0x01020304], np.uint32))
    payload = bytes.fromhex("0001000003000000030000000100000004030201")
    assert b"".join(SORT.encode(message)) == payload
    with mock.patch.object(types, "_SPLIT_FROM", 1):
        assert b"".join(SORT.encode(message)) == payload


@properties
@given(typed_messages, st.sampled_from([1, 8, types._SPLIT_FROM]))
def test_the_parts_joined_are_what_rosbags_makes(typed: tuple[MessageType, Any], split_from: int) -> None:
    kind, message = typed
    with mock.patch.object(types, "_SPLIT_FROM", split_from):
        parts = kind.encode(message)
    assert b"".join(parts) == rosbags_bytes(kind, message)
    last = getattr(message, kind.fields[-1][0])
    assert len(parts) == (2 if kind.name in END_IN_AN_ARRAY and last.nbytes >= split_from else 1)


@properties
@given(typed_messages)
def test_a_decoded_message_encodes_to_the_same_bytes(typed: tuple[MessageType, Any]) -> None:
    kind, message = typed
    payload = b"".join(kind.encode(message))
    for data in (payload, memoryview(payload)):
        decoded = kind.decode(data)
        assert type(decoded) is kind.cls
        assert b"".join(kind.encode(decoded)) == payload


@pytest.mark.parametrize("name", sorted(get_typestore(Stores.ROS2_JAZZY).fielddefs))
def test_every_type_of_jazzy_has_the_bytes_that_rosbags_makes(name: str) -> None:
    kind = REGISTRY.message(name)
    rng = np.random.default_rng(0)
    for _ in range(5):
        message = filled(kind, rng)
        payload = rosbags_bytes(kind, message)
        assert b"".join(kind.encode(message)) == payload
        assert b"".join(kind.encode(kind.decode(payload))) == payload


BASES = ["uint8", "uint16", "float64", "string", "geometry_msgs/Point", "Shorts"]
FIELDS = [base + shape for base in BASES for shape in ("", "[]", "[3]")]


@pytest.mark.parametrize("first", FIELDS)
def test_every_field_lies_behind_every_other_as_rosbags_has_it(first: str) -> None:
    rng = np.random.default_rng(0)
    for number, second in enumerate(FIELDS):
        name = f"lab_msgs/msg/Pair{FIELDS.index(first)}Of{number}"
        REGISTRY.add_message(name, f"{first} first\n{second} second\nfloat64 last")
        kind = REGISTRY.message(name)
        for message in (zero_message(kind), filled(kind, rng), filled(kind, rng)):
            payload = rosbags_bytes(kind, message)
            assert b"".join(kind.encode(message)) == payload
            assert b"".join(kind.encode(kind.decode(payload))) == payload
            assert {outcome(kind, payload[:end]) for end in range(len(payload))} == {"truncated"}


@pytest.mark.parametrize("size", [0, 4, 65532, 65536, 65540, 921600])
@pytest.mark.parametrize(("writeable", "joined_at_once"), [(False, False), (True, True), (True, False)])
def test_a_big_array_is_a_part_of_its_own_and_copied_only_where_somebody_could_change_it(
    size: int, writeable: bool, joined_at_once: bool
) -> None:
    for kind, dtype in ((SORT, np.dtype(np.uint32)), (IMAGE, np.dtype(np.uint8))):
        array = np.arange(size // dtype.itemsize).astype(dtype)
        array.flags.writeable = writeable
        message = kind.cls(array) if kind is SORT else image(array)
        parts = kind.encode(message, joined_at_once=joined_at_once)
        assert len(parts) == (2 if size >= 65536 else 1)
        assert b"".join(parts) == rosbags_bytes(kind, message)
        if len(parts) == 2:
            is_view = np.shares_memory(np.frombuffer(parts[1], np.uint8), array)
            assert is_view == (not writeable or joined_at_once)
        assert isinstance(parts[0], bytes)


@pytest.mark.parametrize("length", [20, 200_000])
def test_every_second_element_is_copied(length: int) -> None:
    every_second = np.arange(length).astype(np.uint16)[::2]
    kind = REGISTRY.message("std_msgs/UInt16MultiArray")
    message = zero_message(kind)
    message.data = every_second
    (payload,) = kind.encode(message)
    assert np.array_equal(kind.decode(payload).data, every_second)
    kind = REGISTRY.message("sensor_msgs/PointCloud2")  # something follows the array
    message = zero_message(kind)
    message.data = np.arange(length).astype(np.uint8)[::2]
    (payload,) = kind.encode(message)
    assert np.array_equal(kind.decode(payload).data, message.data)


@pytest.mark.parametrize("step", [1, 2])
@pytest.mark.parametrize("length", [20, 200_000])
def test_of_a_masked_array_every_element_is_sent(length: int, step: int) -> None:
    masked = np.ma.masked_array(np.arange(length).astype(np.uint32), mask=np.arange(length) % 3 == 0)[::step]
    payload = b"".join(SORT.encode(SORT.cls(masked)))
    assert np.array_equal(SORT.decode(payload).unsorted, np.arange(0, length, step))


def test_what_may_change_before_the_parts_are_joined_is_copied() -> None:
    array = np.zeros(100_000, np.uint8)
    parts = IMAGE.encode(image(array))
    array[:] = 7
    assert not any(parts[1])


def test_encoding_leaves_the_message_as_it_was() -> None:
    array = np.zeros(100_000, np.uint8)
    message = image(array)
    IMAGE.encode(message)
    assert message.data is array


def test_decoded_arrays_are_views_of_the_payload() -> None:
    payload = b"".join(IMAGE.encode(image(np.arange(100_000).astype(np.uint8))))
    decoded = IMAGE.decode(payload)
    assert np.shares_memory(decoded.data, np.frombuffer(payload, np.uint8))
    assert decoded.data.dtype is np.dtype(np.uint8)  # this very object is encoded without a closer look
    assert len(decoded.data) == 100_000


@properties
@given(typed_messages, st.data())
def test_every_truncation_is_refused(typed: tuple[MessageType, Any], data: st.DataObject) -> None:
    kind, message = typed
    payload = b"".join(kind.encode(message))
    length = data.draw(st.integers(0, len(payload) - 1))
    assert refused(kind, payload[:length]).reason == "truncated"


@properties
@given(typed_messages, st.binary(max_size=40))
def test_what_follows_a_message_is_not_looked_at(typed: tuple[MessageType, Any], surplus: bytes) -> None:
    kind, message = typed
    payload = b"".join(kind.encode(message))
    assert b"".join(kind.encode(kind.decode(payload + surplus))) == payload


@properties
@given(st.sampled_from(TYPES), st.binary(max_size=200), st.booleans())
def test_any_bytes_give_a_message_or_a_bad_message_error(
    kind: MessageType, data: bytes, encapsulated: bool
) -> None:
    assert outcome(kind, b"\0\1\0\0" + data if encapsulated else data) in OUTCOMES


@properties
@given(typed_messages, st.data())
def test_damaged_messages_give_a_message_or_a_bad_message_error(
    typed: tuple[MessageType, Any], data: st.DataObject
) -> None:
    kind, message = typed
    payload = bytearray(b"".join(kind.encode(message)))
    at = data.draw(st.integers(4, len(payload) - 1))
    payload[at : at + 4] = data.draw(st.binary(min_size=1, max_size=4))
    assert outcome(kind, bytes(payload)) in OUTCOMES


@pytest.mark.parametrize("name", ["lab_msgs/Wide", "lab_msgs/Names", "lab_msgs/Nested", "std_msgs/String"])
@pytest.mark.parametrize("count", [b"\xff\xff\xff\xff", b"\0\0\0\x40", b"\xff\xff\xff\x7f"])
def test_a_hostile_count_allocates_nothing(name: str, count: bytes) -> None:
    kind = REGISTRY.message(name)
    payload = b"\0\1\0\0" + (b"" if name in {"lab_msgs/Nested", "std_msgs/String"} else bytes(4)) + count
    payload += bytes(64)
    tracemalloc.start()
    try:
        error = refused(kind, payload)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert error.reason == "truncated"
    assert peak < 1_000_000


@pytest.mark.parametrize(
    ("header", "kind"),
    [
        ("0000", "CDR big endian"),
        ("0003", "PL_CDR little endian"),
        ("0007", "CDR2 little endian"),
        ("0009", "D_CDR2 little endian"),
        ("000b", "PL_CDR2 little endian"),
        ("0101", "unknown"),
    ],
)
def test_another_encapsulation_is_named(header: str, kind: str) -> None:
    error = refused(STRING, bytes.fromhex(header) + HELLO[2:])
    assert error.reason == "foreign_encoding"
    assert f"{header} ({kind})" in error.detail


def test_a_sequence_over_its_bound_is_refused() -> None:
    kind = REGISTRY.message("lab_msgs/Bounded")
    payloads = [rosbags_bytes(kind, kind.cls(1, np.zeros(count, np.uint32))) for count in (300, 301)]
    assert len(kind.decode(payloads[0]).data) == 300
    assert "'data' of lab_msgs/msg/Bounded has more than 300" in refused(kind, payloads[1]).detail


def test_the_options_of_the_encapsulation_are_ignored() -> None:
    assert STRING.decode(b"\0\1\0\3" + HELLO[4:]).data == "hello 0"


def test_a_string_that_is_not_utf_8() -> None:
    error = refused(STRING, HELLO.replace(b"hello", b"h\xffllo"))
    assert error.reason == "foreign_encoding"
    assert "not UTF-8" in error.detail


def test_a_string_without_its_final_zero() -> None:
    error = refused(STRING, HELLO[:-1] + b"!")
    assert error.reason == "truncated"
    assert "'data' of std_msgs/msg/String does not end with a zero" in error.detail
