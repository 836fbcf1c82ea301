"""Messages as C structs: against ctypes, which lays structs out as the compiler of this host does."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.c_layout import CLayout
from reconros_zenoh.ros.forms import is_number, number
from reconros_zenoh.ros.type_registry import TypeRegistry

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc

    from reconros_zenoh.ros.types import MessageType

TYPES = TypeRegistry()
IMAGE = TYPES.message("sensor_msgs/msg/Image")

# struct Image of ROS 2 on 32-bit ARM: Header is Time (8 bytes) and a string of three words.
IMAGE_ARM32 = {"header.stamp.nanosec": 4, "header.frame_id.data": 8, "height": 20, "width": 24}
IMAGE_ARM32 |= {"encoding": 28, "is_bigendian": 40, "step": 44, "data.data": 48, "data.size": 52}
IMAGE_ARM64 = {"header.frame_id.data": 8, "height": 32, "encoding.size": 48, "is_bigendian": 64}
IMAGE_ARM64 |= {"step": 68, "data": 72, "data.capacity": 88}


class Sequence(ctypes.Structure):
    """rosidl_runtime_c__String, and every sequence."""

    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("capacity", ctypes.c_size_t))


def as_ctypes(owner: MessageType, form: FieldDesc) -> Any:
    """The C type of a field, as this host's compiler lays it out."""
    if form[0] == Nodetype.NAME:
        return struct_of(owner.nested(form[1]))
    if form[0] == Nodetype.ARRAY:
        return as_ctypes(owner, form[1][0]) * form[1][1]
    return np.ctypeslib.as_ctypes_type(number(form)) if is_number(form) else Sequence


def struct_of(message_type: MessageType) -> Any:
    members = [(name, as_ctypes(message_type, form)) for name, form in message_type.fields]
    return type(message_type.name, (ctypes.Structure,), {"_fields_": members})


@pytest.mark.parametrize(("pointer", "offsets"), [(4, IMAGE_ARM32), (8, IMAGE_ARM64)])
def test_the_offsets_of_an_image(pointer: int, offsets: dict[str, int]) -> None:
    layout = CLayout(pointer)
    assert {path: layout.offsetof(IMAGE, path) for path in offsets} == offsets
    assert layout.struct(IMAGE).size == {4: 60, 8: 96}[pointer]


def test_all_standard_messages_are_laid_out_as_by_the_compiler() -> None:
    assert ctypes.sizeof(ctypes.c_void_p) == 8
    layout = CLayout(8)
    checked = 0
    for name in sorted(TYPES._store.fielddefs):
        if "/msg/" not in name:
            continue
        message_type = TYPES.message(name)
        expected, struct = struct_of(message_type), layout.struct(message_type)
        assert (struct.size, struct.alignment) == (ctypes.sizeof(expected), ctypes.alignment(expected)), name
        for field, (offset, _) in struct.fields.items():
            assert offset == getattr(expected, field).offset, (name, field)
        checked += 1
    assert checked > 100


FIELD_TYPES = ("bool", "uint8", "int16", "uint32", "float64", "string", "uint8[]", "float64[3]", "string[2]")


@settings(max_examples=60)
@given(st.lists(st.sampled_from(FIELD_TYPES), min_size=1, max_size=8))
def test_any_order_of_fields_is_laid_out_as_by_the_compiler(forms: list[str]) -> None:
    registry = TypeRegistry()
    registry.add_message("made_up/msg/Any", "\n".join(f"{form} f{i}" for i, form in enumerate(forms)))
    message_type = registry.message("made_up/msg/Any")
    expected, struct = struct_of(message_type), CLayout(8).struct(message_type)
    assert struct.size == ctypes.sizeof(expected)
    assert [offset for offset, _ in struct.fields.values()] == [
        getattr(expected, name).offset for name, _ in message_type.fields
    ]


@pytest.mark.parametrize("path", ["dat", "data.length", "height.data", "data.data.data", "header.s", ""])
def test_a_field_that_the_message_has_not(path: str) -> None:
    with pytest.raises(UsageError, match=f"sensor_msgs/msg/Image has no '{path}'"):
        CLayout(4).offsetof(IMAGE, path)
