"""Times and pictures as the messages of ROS 2 that hold them."""

from __future__ import annotations

import numpy as np
import pytest

from reconros_zenoh.ros.image import image_message
from reconros_zenoh.ros.stamp import set_stamp, stamp_ns
from reconros_zenoh.ros.type_registry import TypeRegistry

TYPES = TypeRegistry()


@pytest.mark.parametrize(
    ("ns", "sec", "nanosec"), [(0, 0, 0), (999_999_999, 0, 999_999_999), (3_000_000_007, 3, 7)]
)
def test_a_stamp_is_whole_seconds_and_the_nanoseconds_beyond(ns: int, sec: int, nanosec: int) -> None:
    stamp = TYPES.message("builtin_interfaces/msg/Time").cls(sec=-1, nanosec=1)
    set_stamp(stamp, ns)
    assert (stamp.sec, stamp.nanosec) == (sec, nanosec)
    assert stamp_ns(stamp) == ns


@pytest.mark.parametrize(("encoding", "shape", "step"), [("mono8", (2, 3), 3), ("bgr8", (2, 3, 3), 9)])
def test_a_picture_is_its_rows_one_behind_the_other(encoding: str, shape: tuple[int, ...], step: int) -> None:
    picture = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    image = image_message(TYPES, encoding, picture)
    assert (image.height, image.width, image.encoding, image.step) == (2, 3, encoding, step)
    assert image.is_bigendian == 0
    assert image.data.tolist() == list(range(2 * step))
    assert (image.header.stamp.sec, image.header.stamp.nanosec, image.header.frame_id) == (0, 0, "")
