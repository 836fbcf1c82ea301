from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.transport.frames import Frames

KIB = 1024
MIB = 1024 * KIB


class Frame:
    """Takes bytes and bytearrays of the right length only, as the frames of Zenoh do."""

    def __init__(self, size: int) -> None:
        self.content = bytearray(b"\xff") * size  # parts begin with other bytes

    def __setitem__(self, place: slice, data: bytes | bytearray) -> None:
        assert isinstance(data, (bytes, bytearray))
        assert place.stop - place.start == len(data)
        self.content[place] = data
        assert len(self.content) >= place.stop


class SharedMemory:
    """Opens pools, as long as there is room, and remembers them; its frames are never given back."""

    def __init__(self, room: int) -> None:
        self.room = room
        self.asked: list[int] = []

    def open_pool(self, pool_bytes: int) -> object:
        self.asked.append(pool_bytes)
        if pool_bytes > self.room:
            return None
        free = [pool_bytes]

        def allocate(size: int) -> Frame | None:
            if size > free[0]:
                return None
            free[0] -= size
            return Frame(size)

        return allocate


def behind_a_header(content: bytes) -> memoryview:
    return memoryview(b"header" + content)[6:]


def before_a_trailer(content: bytes) -> memoryview:
    return memoryview(content + b"trailer")[:-7]


def array(content: bytes) -> memoryview:
    return memoryview(np.frombuffer(bytearray(content), np.uint8))


part = st.builds(
    lambda size, kind: kind((bytes(range(256)) * (size // 256 + 1))[:size]),
    st.integers(0, 700 * KIB),
    st.sampled_from([bytes, bytearray, memoryview, behind_a_header, before_a_trailer, array]),
)


@given(st.lists(part, max_size=4))
def test_the_content_is_that_of_the_parts(parts: list[bytes]) -> None:
    joined = Frames(SharedMemory(64 * MIB).open_pool).join(parts)
    assert (joined.content if isinstance(joined, Frame) else joined) == b"".join(parts)
    assert isinstance(joined, Frame) == (sum(map(len, parts)) >= 256 * KIB)


def test_small_payloads_open_no_pool() -> None:
    memory = SharedMemory(64 * MIB)
    assert Frames(memory.open_pool).join([bytes(256 * KIB - 1)]) == bytes(256 * KIB - 1)
    assert memory.asked == []


def test_a_pool_holds_four_frames_and_then_payloads_are_bytes() -> None:
    memory = SharedMemory(64 * MIB)
    frames = Frames(memory.open_pool)
    payloads = [frames.join([bytes(6 * MIB)]) for _ in range(8)]
    assert [isinstance(payload, Frame) for payload in payloads[:4]] == [True] * 4
    assert isinstance(payloads[-1], bytes)
    assert len(memory.asked) == 1


def test_a_larger_frame_gets_a_larger_pool_and_a_smaller_one_uses_it() -> None:
    memory = SharedMemory(64 * MIB)
    frames = Frames(memory.open_pool)
    for size in (1, 1, 3, 2):
        assert isinstance(frames.join([bytes(size * MIB)]), Frame)
    assert memory.asked == [4 * MIB + MIB, 16 * MIB + MIB]


@pytest.mark.parametrize("mib", [17, 40])
def test_four_frames_beyond_64_mib_are_bytes(mib: int) -> None:
    memory = SharedMemory(10**12)
    assert isinstance(Frames(memory.open_pool).join([bytes(mib * MIB)]), bytes)
    assert memory.asked == []


def test_memory_that_is_not_there_is_asked_for_once() -> None:
    memory = SharedMemory(2 * MIB)
    frames = Frames(memory.open_pool)
    for _ in range(3):
        assert isinstance(frames.join([bytes(MIB)]), bytes)
    assert memory.asked == [5 * MIB]
    assert isinstance(frames.join([bytes(256 * KIB)]), Frame)
