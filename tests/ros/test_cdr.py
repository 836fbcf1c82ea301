"""Messages as CDR bytes: the same as rosbags makes, in parts, and safe to read from anyone."""

from __future__ import annotations

import tracemalloc
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.ros import types
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from reconros_zenoh.ros.types import MessageType

REGISTRY = TypeRegistry()
REGISTRY.add_service("sorter_msgs/srv/Sort", "uint32[] unsorted\n---\nuint32[] sorted\n")
REGISTRY.add_message("lab_msgs/msg/Bools", "string name\nbool[] flags\n")
REGISTRY.add_message("lab_msgs/msg/Shorts", "uint8 id\nint16[] data\n")
REGISTRY.add_message("lab_msgs/msg/Bounded", "uint8 id\nuint32[<=300] data\n")
REGISTRY.add_message("lab_msgs/msg/Wide", "uint8 id\nuint64[] data\n")
REGISTRY.add_message("lab_msgs/msg/Names", "uint8[3] rgb\nstring[] names\n")
REGISTRY.add_message("lab_msgs/msg/Nested", "Wide[] wide\nShorts[2] shorts\nfloat64 last\n")
REGISTRY.add_message("lab_msgs/msg/Floats", "float32[] data\n")
REGISTRY.add_message("lab_msgs/msg/Joint", "string<=4 name\n")
REGISTRY.add_message(
    "lab_msgs/msg/Arm",
    "Joint[2] joints\nstring[2] names\nfloat64[2] pose\nint16[<=2] codes\n"
    "string<=2[] tags\nstring[] labels\n",
)
REGISTRY.add_message("lab_msgs/msg/Keyword", "uint8 from\nuint8[] import\n")

TYPES = [
    REGISTRY.message(name)
    for name in (
        "std_msgs/String",
        "std_msgs/Empty",
        "std_msgs/UInt32",
        "std_msgs/UInt32MultiArray",
        "std_msgs/ByteMultiArray",
        "sensor_msgs/Image",
        "sensor_msgs/PointCloud2",
        "sensor_msgs/JointState",
        "sensor_msgs/LaserScan",
        "sensor_msgs/Imu",
        "sensor_msgs/BatteryState",
        "sorter_msgs/srv/Sort_Request",
        "lab_msgs/Bools",
        "lab_msgs/Shorts",
        "lab_msgs/Bounded",
        "lab_msgs/Wide",
        "lab_msgs/Names",
        "lab_msgs/Nested",
        "lab_msgs/Keyword",
    )
]
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
SORT = REGISTRY.message("sorter_msgs/srv/Sort_Request")
STRING = REGISTRY.message("std_msgs/String")
IMAGE = REGISTRY.message("sensor_msgs/Image")
HELLO = bytes.fromhex("000100000800000068656c6c6f203000")

DTYPES = {"byte": "uint8"}

properties = settings(max_examples=150)


def arrays(base: str, least: int, most: int) -> st.SearchStrategy[np.ndarray[Any, Any]]:
    limit = 2 if base == "bool" else 100

    def array(count: int, seed: int) -> np.ndarray[Any, Any]:
        return np.random.default_rng(seed).integers(0, limit, count).astype(DTYPES.get(base, base))

    return st.builds(array, st.integers(least, most), st.integers(0, 9))


def scalars(base: str) -> st.SearchStrategy[Any]:
    if base == "string":
        return st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
    if base == "bool":
        return st.booleans()
    if base == "byte":
        return st.integers(0, 127)  # for rosbags it is signed
    dtype = np.dtype(base)
    if dtype.kind == "f":
        return st.floats(width=32 if dtype.itemsize == 4 else 64, allow_nan=False)
    limits = np.iinfo(dtype)
    return st.integers(int(limits.min), int(limits.max))


def values(form: Any) -> st.SearchStrategy[Any]:
    """Return values of a field that rosbags describes by `form`."""
    if form[0] == Nodetype.BASE:
        return scalars(form[1][0])
    if form[0] == Nodetype.NAME:
        return messages(form[1])
    element, size = form[1]
    least, most = (size, size) if form[0] == Nodetype.ARRAY else (0, size or 20)
    if element[0] == Nodetype.BASE and element[1][0] != "string":
        return arrays(element[1][0], least, most)
    return st.lists(values(element), min_size=least, max_size=min(most, max(least, 3)))


def messages(name: str) -> st.SearchStrategy[Any]:
    definition = REGISTRY._store.get_msgdef(name)
    return st.builds(definition.cls, *(values(form) for _, form in definition.fields))


def filled(kind: MessageType, rng: np.random.Generator) -> Any:
    """Return a message whose numbers are not 0 and whose sequences have up to three elements."""

    def value(form: Any) -> Any:
        if form[0] == Nodetype.NAME:
            return filled(kind.nested(form[1]), rng)
        if form[0] == Nodetype.BASE:
            if form[1][0] == "string":
                return "x" * int(rng.integers(9))
            return dtype_of(form).type(rng.integers(1, 100)).item()
        element, length = form[1]
        count = length if form[0] == Nodetype.ARRAY else int(rng.integers(min(length or 3, 3) + 1))
        elements = [value(element) for _ in range(count)]
        is_number = element[0] == Nodetype.BASE and element[1][0] != "string"
        return np.array(elements, dtype_of(element)) if is_number else elements

    return kind.cls(*(value(form) for _, form in kind.fields))


def dtype_of(form: Any) -> np.dtype[Any]:
    return np.dtype(DTYPES.get(form[1][0], form[1][0]))


typed_messages = st.sampled_from(TYPES).flatmap(lambda kind: st.tuples(st.just(kind), messages(kind.name)))


def rosbags_bytes(kind: MessageType, message: object) -> bytes:
    return bytes(REGISTRY._store.serialize_cdr(message, kind.name, little_endian=True))


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


def test_encoding_leaves_the_message_as_it_was() -> None:
    array = np.zeros(100_000, np.uint8)
    message = image(array)
    IMAGE.encode(message)
    assert message.data is array


def test_decoded_arrays_are_views_of_the_payload() -> None:
    payload = b"".join(IMAGE.encode(image(np.arange(100_000).astype(np.uint8))))
    decoded = IMAGE.decode(payload)
    assert np.shares_memory(decoded.data, np.frombuffer(payload, np.uint8))
    assert decoded.data.dtype == np.uint8
    assert len(decoded.data) == 100_000


@pytest.mark.parametrize(
    "array",
    [
        [1, 2, 3],
        None,
        np.zeros((300, 300), np.uint32),
        np.zeros(100_000, np.uint8),
        np.zeros(100_000, np.float64),
        np.uint32(7),
    ],
)
def test_a_field_that_does_not_fit_is_a_usage_error(array: Any) -> None:
    with pytest.raises(UsageError, match="sorter_msgs/srv/Sort_Request cannot be serialised") as caught:
        SORT.encode(SORT.cls(array))
    assert "numpy arrays of the dtype of the field" in str(caught.value)


@pytest.mark.parametrize("value", [-1, 2**32, 1.5, "1", None])
def test_a_number_that_does_not_fit_is_a_usage_error(value: Any) -> None:
    kind = REGISTRY.message("std_msgs/UInt32")
    with pytest.raises(UsageError, match="cannot be serialised"):
        kind.encode(kind.cls(value))


@pytest.mark.parametrize("value", [7, None, b"seven"])
def test_what_is_no_string_is_a_usage_error(value: Any) -> None:
    with pytest.raises(UsageError, match="cannot be serialised"):
        STRING.encode(STRING.cls(value))


@pytest.mark.parametrize("value", [True, False, np.bool_(True)])
def test_a_bool(value: Any) -> None:
    kind = REGISTRY.message("std_msgs/Bool")
    assert b"".join(kind.encode(kind.cls(value))) == b"\0\1\0\0" + bytes([bool(value)])


@pytest.mark.parametrize("value", ["no", 1, None, 0.0])
def test_what_is_true_or_false_is_no_bool(value: Any) -> None:
    kind = REGISTRY.message("std_msgs/Bool")
    with pytest.raises(UsageError, match=f"'data' of std_msgs/msg/Bool is {value!r}, not a bool"):
        kind.encode(kind.cls(value))


def test_a_number_beyond_those_of_its_type_is_a_usage_error() -> None:
    kind = REGISTRY.message("std_msgs/Float32")
    with pytest.raises(UsageError, match="cannot be serialised: float too large"):
        kind.encode(kind.cls(1e300))


FLOATS = REGISTRY.message("lab_msgs/msg/Floats")
WRONG_DTYPES = [np.int32, np.uint32, ">f4", np.float64, np.bool_]


@pytest.mark.parametrize("length", [0, 3, 100_000])
@pytest.mark.parametrize("dtype", WRONG_DTYPES)
def test_an_array_of_another_dtype_is_a_usage_error_that_names_the_field(length: int, dtype: Any) -> None:
    array = np.ones(length, dtype)
    with pytest.raises(UsageError) as caught:
        FLOATS.encode(FLOATS.cls(array))
    assert (
        f"field 'data' of lab_msgs/msg/Floats is an array of {array.dtype}, not an array of float32"
        in str(caught.value)
    )


def test_an_array_of_another_dtype_in_a_message_within() -> None:
    wide, shorts = REGISTRY.message("lab_msgs/Wide").cls, REGISTRY.message("lab_msgs/Shorts").cls
    kind = REGISTRY.message("lab_msgs/Nested")
    right = shorts(1, np.zeros(2, np.int16))
    kind.encode(kind.cls([wide(1, np.zeros(2, np.uint64))], [right, right], 0.5))
    with pytest.raises(UsageError, match="'data' of lab_msgs/msg/Wide is an array of int64, not an array"):
        kind.encode(kind.cls([wide(1, np.zeros(2, np.int64))], [right, right], 0.5))
    with pytest.raises(UsageError, match="'data' of lab_msgs/msg/Shorts is a list, not an array of int16"):
        kind.encode(kind.cls([], [right, shorts(1, [1])], 0.5))


def test_an_array_of_another_dtype_in_the_only_message_within() -> None:
    kind = REGISTRY.message("geometry_msgs/PoseWithCovarianceStamped")
    message = zero_message(kind)
    kind.encode(message)
    message.pose.covariance = np.zeros(36, np.int64)
    with pytest.raises(UsageError, match="'covariance' of geometry_msgs/msg/PoseWithCovariance is an array"):
        kind.encode(message)


JOINT = REGISTRY.message("lab_msgs/Joint").cls
FORMS = {
    "too few messages": ("joints", [JOINT("a")], "field 'joints' of lab_msgs/msg/Arm is of length 1, not 2"),
    "too many messages": (
        "joints",
        [JOINT("a")] * 3,
        "field 'joints' of lab_msgs/msg/Arm is of length 3, not 2",
    ),
    "nested": (
        "joints",
        [JOINT("12345")] * 2,
        "field 'name' of lab_msgs/msg/Joint is of length 5, not at most 4",
    ),
    "strings": ("names", ["a"], "field 'names' of lab_msgs/msg/Arm is of length 1, not 2"),
    # For NumPy None is as good as float64.
    "no array": ("pose", [0.0, 0.0], "field 'pose' of lab_msgs/msg/Arm is a list, not an array of float64"),
    "numbers": ("pose", np.zeros(1), "field 'pose' of lab_msgs/msg/Arm is of length 1, not 2"),
    "bounded": (
        "codes",
        np.zeros(3, np.int16),
        "field 'codes' of lab_msgs/msg/Arm is of length 3, not at most 2",
    ),
    "bounded string": (
        "tags",
        ["1", "123"],
        "an element of field 'tags' of lab_msgs/msg/Arm is of length 3, not",
    ),
    "letters": ("labels", "ab", "field 'labels' of lab_msgs/msg/Arm is a str, not a list of them"),
}


@pytest.mark.parametrize(("field", "value", "told"), FORMS.values(), ids=FORMS)
def test_a_field_of_another_form_is_a_usage_error_that_names_it(field: str, value: Any, told: str) -> None:
    kind = REGISTRY.message("lab_msgs/Arm")
    message = zero_message(kind)
    kind.encode(message)
    setattr(message, field, value)
    with pytest.raises(UsageError, match=f"cannot be serialised: {told}"):
        kind.encode(message)


def test_a_byte_has_no_sign() -> None:
    kind = REGISTRY.message("std_msgs/Byte")
    assert kind.encode(kind.cls(200)) == (b"\0\1\0\0\xc8",)
    assert kind.decode(b"\0\1\0\0\xc8").data == 200
    with pytest.raises(UsageError, match="cannot be serialised"):
        kind.encode(kind.cls(-56))
    kind = REGISTRY.message("std_msgs/ByteMultiArray")
    message = zero_message(kind)
    message.data = np.array([1, 200], np.uint8)
    payload = b"".join(kind.encode(message))
    assert payload[-2:] == b"\x01\xc8"
    assert kind.decode(payload).data.tolist() == [1, 200]
    message.data = message.data.view(np.int8)
    with pytest.raises(UsageError, match="'data' of std_msgs/msg/ByteMultiArray is an array of int8"):
        kind.encode(message)


@pytest.mark.parametrize(
    ("message", "told"),
    [
        (REGISTRY.message("std_msgs/Int32").cls(7), "one of type std_msgs/msg/Int32"),
        (None, "None"),
        ("seven", "'seven'"),
    ],
)
def test_a_message_of_another_type_is_a_usage_error(message: object, told: str) -> None:
    with pytest.raises(UsageError) as caught:
        REGISTRY.message("std_msgs/UInt32").encode(message)
    assert str(caught.value) == f"A message of type std_msgs/msg/UInt32 is wanted, not {told}."


def test_a_message_of_another_registry_is_one_of_its_type() -> None:
    other = TypeRegistry()
    other.add_message("lab_msgs/msg/Wide", "uint8 id\nuint64[] data\n")
    message = other.message("lab_msgs/Wide").cls(1, np.zeros(2, np.uint64))
    kind = REGISTRY.message("lab_msgs/Wide")
    assert type(message) is not kind.cls
    assert kind.encode(message) == other.message("lab_msgs/Wide").encode(message)


def test_half_a_character_is_a_usage_error() -> None:
    with pytest.raises(UsageError, match="cannot be serialised"):
        STRING.encode(STRING.cls("\ud800"))


@properties
@given(typed_messages, st.data())
def test_every_truncation_is_refused(typed: tuple[MessageType, Any], data: st.DataObject) -> None:
    kind, message = typed
    payload = b"".join(kind.encode(message))
    length = data.draw(st.integers(0, len(payload) - 1))
    assert refused(kind, payload[:length]).reason == "truncated"


@properties
@given(typed_messages, st.integers(1, 9))
def test_only_padding_may_follow_a_message(typed: tuple[MessageType, Any], surplus: int) -> None:
    kind, message = typed
    payload = b"".join(kind.encode(message))
    if surplus <= -len(payload) % 4:
        assert b"".join(kind.encode(kind.decode(payload + bytes(surplus)))) == payload
    else:
        assert refused(kind, payload + bytes(surplus)).reason == "truncated"


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
    assert refused(STRING, HELLO[:-1] + b"!").reason == "truncated"


def image(array: Any) -> Any:
    time = REGISTRY.message("builtin_interfaces/Time").cls(1, 2)
    header = REGISTRY.message("std_msgs/Header").cls(time, "camera")
    return IMAGE.cls(header, 480, 640, "bgr8", 0, 1920, array)
