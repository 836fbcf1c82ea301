"""Messages of which some fields are given, as on the command line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.ros.zero_message import message_of

types = TypeRegistry()


def test_what_is_not_given_is_zero() -> None:
    image = message_of(types.message("sensor_msgs/msg/Image"), {"width": 3, "header": {"frame_id": "eye"}})
    assert (image.width, image.height, image.header.frame_id, image.header.stamp.sec) == (3, 0, "eye", 0)
    assert image.data.dtype == np.uint8
    assert not image.data.size


def test_lists_become_arrays_of_the_fields_type_and_lists_of_messages() -> None:
    scan = message_of(types.message("sensor_msgs/msg/LaserScan"), {"ranges": [1, 2.5], "angle_min": -1})
    assert scan.ranges.dtype == np.float32
    assert scan.ranges.tolist() == [1, 2.5]
    assert scan.angle_min == -1
    path = message_of(types.message("nav_msgs/msg/Path"), {"poses": [{"pose": {"position": {"x": 2.0}}}, {}]})
    assert [pose.pose.position.x for pose in path.poses] == [2, 0]


@pytest.mark.parametrize(
    ("type_name", "fields", "says"),
    [
        ("std_msgs/msg/UInt32", {"date": 1}, "has no field 'date'. Its fields: data."),
        ("std_msgs/msg/Empty", {"data": 1}, "Its fields: "),
        ("std_msgs/msg/UInt32", {"data": -1}, "field 'data' of std_msgs/msg/UInt32 cannot be -1"),
        ("std_msgs/msg/UInt32", {"data": 1.5}, "cannot be 1.5: it is a uint32."),
        ("std_msgs/msg/UInt32", {"data": True}, "cannot be True"),
        ("std_msgs/msg/Bool", {"data": 1}, "cannot be 1: it is a bool."),
        ("std_msgs/msg/String", {"data": 1}, "cannot be 1: it is a string."),
        ("std_msgs/msg/Header", {"stamp": 5}, "cannot be 5: it is a message, given by its fields."),
        ("sensor_msgs/msg/LaserScan", {"ranges": 1}, "cannot be 1: it is a list."),
        ("sensor_msgs/msg/LaserScan", {"ranges": ["a"]}, "it is a float32."),
        ("std_msgs/msg/Float32", {"data": 1e300}, "cannot be 1e+300: overflow"),
        ("sensor_msgs/msg/Imu", {"orientation_covariance": [1, 2]}, "it has 9 elements."),
        ("std_msgs/msg/Header", {"stamp": {"sec": "x"}}, "field 'sec' of builtin_interfaces/msg/Time"),
    ],
)
def test_what_does_not_fit_is_refused(type_name: str, fields: dict[str, Any], says: str) -> None:
    with pytest.raises(UsageError) as caught:
        message_of(types.message(type_name), fields)
    assert says in str(caught.value)
