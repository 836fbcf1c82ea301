"""Types with fields of many kinds, messages of them, and what rosbags makes of those."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from reconros_zenoh.ros.type_registry import TypeRegistry

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
SORT = REGISTRY.message("sorter_msgs/srv/Sort_Request")
STRING = REGISTRY.message("std_msgs/String")
IMAGE = REGISTRY.message("sensor_msgs/Image")

DTYPES = {"byte": "uint8"}

properties = settings(max_examples=150)


def arrays(base: str, least: int, most: int) -> st.SearchStrategy[np.ndarray[Any, Any]]:
    limit = 2 if base == "bool" else 100

    def array(count: int, seed: int) -> np.ndarray[Any, Any]:
        return np.random.default_rng(seed).integers(0, limit, count).astype(DTYPES.get(base, base))

    return st.builds(array, st.integers(least, most), st.integers(0, 9))


def scalars(base: str, bound: int) -> st.SearchStrategy[Any]:
    if base == "string":
        return st.text(st.characters(exclude_categories=["Cs"]), max_size=bound or 12)
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
        return scalars(*form[1])
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


def image(array: Any) -> Any:
    time = REGISTRY.message("builtin_interfaces/Time").cls(1, 2)
    header = REGISTRY.message("std_msgs/Header").cls(time, "camera")
    return IMAGE.cls(header, 480, 640, "bgr8", 0, 1920, array)
