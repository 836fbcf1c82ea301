"""Main memory at virtual addresses: exact bounds, and messages that come out as they went in."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_board import types

from reconros_zenoh.board.address_space import AddressSpace, UnmappedError


def octets(*values: int) -> Any:
    return np.array(values, np.uint8)


def frozen(*values: int) -> Any:
    array = octets(*values)
    array.flags.writeable = False
    return array


def test_bytes_are_where_they_were_mapped() -> None:
    space = AddressSpace()
    address = space.map(octets(1, 2, 3, 4))
    assert space.read(address + 1, 2).tolist() == [2, 3]
    space.write(address + 2, octets(9))
    assert space.read(address, 4).tolist() == [1, 2, 9, 4]


@pytest.mark.parametrize(("offset", "size"), [(-1, 1), (-1, 2), (0, 5), (4, 1), (3, 2), (0, -1), (4096, 4)])
def test_outside_a_block_there_is_nothing(offset: int, size: int) -> None:
    space = AddressSpace()
    address = space.map(octets(1, 2, 3, 4))
    space.map(octets(*range(200)))
    with pytest.raises(UnmappedError):
        space.read(address + offset, size)


def test_nothing_is_written_when_not_all_of_it_fits() -> None:
    space = AddressSpace()
    address = space.map(octets(1, 2))
    with pytest.raises(UnmappedError):
        space.write(address, octets(7, 7, 7))
    assert space.read(address, 2).tolist() == [1, 2]


def test_what_is_unmapped_is_gone_and_not_soon_used_again() -> None:
    space = AddressSpace()
    address = space.map(octets(1))
    space.unmap(address)
    assert space.map(octets(2)) != address
    with pytest.raises(UnmappedError):
        space.read(address, 1)


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(0, 20_000), st.booleans()), max_size=40))
def test_blocks_never_touch(steps: list[tuple[int, bool]]) -> None:
    space = AddressSpace()
    mapped: list[tuple[int, int]] = []
    for size, take_away in steps:
        if take_away and mapped:
            space.unmap(mapped.pop(0)[0])
        mapped.append((space.map(np.zeros(size, np.uint8)), size))
        blocks = sorted(mapped)
        assert all(a + size < b for (a, size), (b, _) in pairwise(blocks))


def test_a_full_space_is_used_again_from_the_beginning() -> None:
    space = AddressSpace()
    big = np.broadcast_to(octets(0), 900 << 20)  # one byte, seen 943718400 times
    first, second, third = (space.map(big) for _ in range(3))
    with pytest.raises(MemoryError):
        space.map(big)
    space.unmap(first)
    assert space.map(octets(1)) > third
    assert space.map(big[: 800 << 20]) == first
    assert second < third


def test_a_block_that_stays_at_the_end_does_not_keep_the_beginning_from_being_used_again() -> None:
    space = AddressSpace()
    big = np.broadcast_to(octets(0), 900 << 20)
    first, second, stays = (space.map(big) for _ in range(3))
    space.unmap(first)
    space.unmap(second)
    assert space.map(big) == first  # round, as nothing fits behind the one that stays
    space.unmap(first)
    assert space.map(big) == second
    space.unmap(second)
    assert space.map(big) == first
    assert space.map(big) == second < stays


def test_a_messages_own_bytes_are_never_changed() -> None:
    image_type = types().message("std_msgs/msg/UInt8MultiArray")
    data = frozen(1, 2, 3)
    layout = types().message("std_msgs/msg/MultiArrayLayout").cls(dim=[], data_offset=0)
    space = AddressSpace()
    placed = space.place(image_type, image_type.cls(layout=layout, data=data))
    pointer = space.read(placed.address + space.layout.offsetof(image_type, "data.data"), 4).view("<u4")[0]
    before = placed.load()
    space.write(int(pointer), octets(9))
    assert data.tolist() == before.data.tolist() == [1, 2, 3]
    assert placed.load().data.tolist() == [9, 2, 3]


def test_memory_that_a_message_was_read_from_stays_the_memory_that_it_was() -> None:
    """A pointer of a message may lead into memory that hardware and software share."""
    message_type = types().message("std_msgs/msg/UInt8MultiArray")
    layout = types().message("std_msgs/msg/MultiArrayLayout").cls(dim=[], data_offset=0)
    space, shared = AddressSpace(), octets(1, 2, 3)
    address = space.map(shared)
    placed = space.place(message_type, message_type.cls(layout=layout, data=octets(0)))
    sequence = np.array([address, 3, 3], np.uint32).view(np.uint8)
    space.write(placed.address + space.layout.offsetof(message_type, "data"), sequence)
    loaded = placed.load()
    space.write(address, octets(9))
    assert loaded.data.tolist() == [1, 2, 3]
    assert shared.tolist() == [9, 2, 3]


TEXT = """
bool yes
int16 small
float64 wide
string text
string[] words
uint16[] numbers
float32[2] pair
bool[] flags
geometry_msgs/Point point
builtin_interfaces/Time[] times
string[2] two
"""


@pytest.mark.parametrize("pointer_bytes", [4, 8])
@settings(max_examples=40)
@given(data=st.data())
def test_a_message_comes_out_as_it_went_in(pointer_bytes: int, data: st.DataObject) -> None:
    registry = types()
    if "made_up/msg/Everything" not in registry._store.fielddefs:
        registry.add_message("made_up/msg/Everything", TEXT)
    everything = registry.message("made_up/msg/Everything")
    point = registry.message("geometry_msgs/msg/Point").cls
    time = registry.message("builtin_interfaces/msg/Time").cls
    # rosidl strings hold no NUL in the middle of what is compared here.
    texts = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=5)
    draw = data.draw
    message = everything.cls(
        yes=draw(st.booleans()),
        small=draw(st.integers(-(2**15), 2**15 - 1)),
        wide=draw(st.floats(allow_nan=False)),
        text=draw(texts),
        words=draw(st.lists(texts, max_size=3)),
        numbers=np.array(draw(st.lists(st.integers(0, 65535), max_size=5)), np.uint16),
        pair=np.array([1.5, -2.5], np.float32),
        flags=np.array(draw(st.lists(st.booleans(), max_size=3)), np.bool_),
        point=point(x=1.0, y=2.0, z=draw(st.floats(allow_nan=False))),
        times=[time(sec=n, nanosec=7) for n in draw(st.lists(st.integers(-9, 9), max_size=3))],
        two=[draw(texts), "b"],
    )
    space = AddressSpace(pointer_bytes)
    placed = space.place(everything, message)
    assert b"".join(everything.encode(placed.load())) == b"".join(everything.encode(message))
    placed.unmap()
    assert not space._blocks
