"""Messages whose fields do not have their types: a usage error that names the field."""

from __future__ import annotations

import re
from operator import attrgetter
from typing import Any

import numpy as np
import pytest
from cdr_cases import REGISTRY, SORT, STRING

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.ros.zero_message import zero_message


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
    told = f"cannot be serialised: field 'data' of std_msgs/msg/UInt32 is {value!r}: "
    with pytest.raises(UsageError, match=re.escape(told)):
        kind.encode(kind.cls(value))


POSE = REGISTRY.message("geometry_msgs/PoseStamped")


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("pose.position.y", "1", "field 'y' of geometry_msgs/msg/Point is '1': required argument"),
        ("header.stamp.sec", 2**40, "field 'sec' of builtin_interfaces/msg/Time is 1099511627776: "),
        ("header.frame_id", 7, "field 'frame_id' of std_msgs/msg/Header is 7: 'int' object has no"),
        ("header.stamp", None, "field 'stamp' of std_msgs/msg/Header is None: "),
        ("pose", POSE.cls, "field 'pose' of geometry_msgs/msg/PoseStamped is <class "),
    ],
)
def test_the_field_of_a_value_that_does_not_fit_is_named(path: str, value: Any, told: str) -> None:
    message = zero_message(POSE)
    owner, _, name = path.rpartition(".")
    setattr(attrgetter(owner)(message) if owner else message, name, value)
    with pytest.raises(UsageError, match=f"PoseStamped cannot be serialised: {told}"):
        POSE.encode(message)


def test_a_field_that_was_deleted_is_a_usage_error() -> None:
    message = zero_message(POSE)
    del message.header.stamp
    with pytest.raises(UsageError, match="field 'stamp' of std_msgs/msg/Header is None: "):
        POSE.encode(message)


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
    with pytest.raises(UsageError, match=r"'data' of std_msgs/msg/Float32 is 1e.300: float too large"):
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


def test_an_array_of_two_dimensions_is_told() -> None:
    with pytest.raises(
        UsageError, match="'unsorted' of sorter_msgs/srv/Sort_Request has 2 dimensions, not one"
    ):
        SORT.encode(SORT.cls(np.zeros((2, 2), np.uint32)))


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
