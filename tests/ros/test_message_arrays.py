"""The arrays of a message: where they lie, who can change them, and a message as it is at one moment."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.ros.message_arrays import arrays_of, is_unchanging, lies_in, snapshot
from reconros_zenoh.ros.type_registry import TypeRegistry

REGISTRY = TypeRegistry()
WORDS = REGISTRY.message("std_msgs/msg/UInt32MultiArray").cls
LAYOUT = REGISTRY.message("std_msgs/msg/MultiArrayLayout").cls
SCAN = REGISTRY.message("sensor_msgs/msg/MultiEchoLaserScan")
ECHO = REGISTRY.message("sensor_msgs/msg/LaserEcho").cls


def read_only(array: Any) -> Any:
    array.flags.writeable = False
    return array


WHOLE = np.arange(20, dtype=np.uint32)

UNCHANGING = {
    "read-only": (read_only(np.zeros(3)), True),
    "a view of it": (read_only(np.zeros(3))[1:], True),
    "of bytes": (np.frombuffer(b"1234", np.uint8), True),
    "of a view of bytes": (np.frombuffer(memoryview(b"1234")[1:], np.uint8), True),
    "writeable": (np.zeros(3), False),
    "a read-only view of a writeable one": (read_only(np.zeros(3)[1:]), False),
    "a read-only one of changing bytes": (read_only(np.frombuffer(bytearray(4), np.uint8)), False),
}


@pytest.mark.parametrize(("array", "expected"), UNCHANGING.values(), ids=UNCHANGING.keys())
def test_who_can_change_an_array(array: Any, expected: bool) -> None:
    assert is_unchanging(array) == expected


@pytest.mark.parametrize(("array", "expected"), UNCHANGING.values(), ids=UNCHANGING.keys())
def test_a_snapshot_copies_what_somebody_can_change(array: Any, expected: bool) -> None:
    taken = snapshot(array)
    assert (taken is array) == expected
    assert is_unchanging(taken)
    assert np.array_equal(taken, array)


def test_a_snapshot_of_a_message_does_not_change_with_it() -> None:
    message = REGISTRY.message("sensor_msgs/msg/LaserEcho").cls(echoes=np.array([1, 2], np.float32))
    several = [message, message]
    taken = snapshot(several)
    message.echoes[0] = 7
    message.echoes = np.zeros(1, np.float32)
    several.clear()
    assert [echo.echoes.tolist() for echo in taken] == [[1, 2], [1, 2]]


def test_the_arrays_of_a_message_and_of_those_in_it() -> None:
    fields: dict[str, Any] = {name: None for name, _ in SCAN.fields}
    first, second, third = (np.zeros(length, np.float32) for length in (1, 2, 3))
    fields |= {"ranges": [ECHO(first), ECHO(second)], "intensities": [ECHO(third)]}
    found = list(arrays_of(SCAN.cls(**fields)))
    assert [array is expected for array, expected in zip(found, (first, second, third), strict=True)]
    assert not list(arrays_of(LAYOUT(dim=[], data_offset=0)))


slices = st.slices(20)


@given(slices, slices)
def test_what_lies_in_an_array(part: slice, whole: slice) -> None:
    places, allowed = (set(range(20)[chosen]) for chosen in (part, whole))
    if places and allowed:
        within = min(allowed) <= min(places) and max(places) <= max(allowed)
        assert lies_in(WHOLE[part], WHOLE[whole]) == within
    assert not places or not lies_in(WHOLE[part], np.arange(20, dtype=np.uint32))
