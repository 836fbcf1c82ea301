"""Bitstream files: what is written comes back, and no other file passes for it."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.board.bitstream import Bitstream, read_bitstreams
from reconros_zenoh.errors import BitstreamError, FileError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

SOBEL = Bitstream(slot=3, callback="sobel", size=200)
REMEDY = "Write it again with `reconros build`"

names = st.text("abcdefghijklmnopqrstuvwxyz_0123456789", min_size=1, max_size=12) | st.just("größe")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bitstreams")


def refusal(read: Callable[[], object], path: Path) -> str:
    """What is said of a file that must be refused, between its path and the remedy."""
    with pytest.raises(BitstreamError) as caught:
        read()
    assert caught.value.path == path
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    said, remedy, _ = text.removeprefix(f"{path}: ").partition(f" {REMEDY}")
    assert remedy
    return said


def test_the_name_is_that_of_reconros() -> None:
    assert SOBEL.file_name == "pblock_slot_3_sobel_3_partial.bit"


@given(st.integers(0, 40) | st.just(10**18), names, st.integers(100, 5000))
def test_what_is_written_comes_back(folder: Path, slot: int, callback: str, size: int) -> None:
    bitstream = Bitstream(slot, callback, size)
    path = bitstream.write(folder)
    assert path == folder / bitstream.file_name
    assert path.stat().st_size == size
    assert Bitstream.read(path) == bitstream


def test_the_body_takes_no_disk_space(tmp_path: Path) -> None:
    path = Bitstream(0, "sobel", 5_285_728).write(tmp_path)
    assert path.stat().st_size == 5_285_728
    assert path.stat().st_blocks * 512 < 100_000


def test_the_folder_is_made(tmp_path: Path) -> None:
    assert SOBEL.write(tmp_path / "deep" / "er").is_file()


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match=r"file.pblock_slot_3_.* cannot be written .* another folder"):
        SOBEL.write(tmp_path / "file")


def test_a_name_that_is_too_long_for_a_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"cannot be written .File name too long"):
        Bitstream(0, 70_000 * "a", 100_000).write(tmp_path)


def test_a_bitstream_too_small_for_its_header() -> None:
    with pytest.raises(UsageError, match="10 bytes has no room for its header"):
        Bitstream(0, "sobel", 10).write(Path("never"))


def test_an_executor_gets_what_it_wants(tmp_path: Path) -> None:
    wanted = [SOBEL, Bitstream(2, "sobel", 300), Bitstream(3, "hash", 200)]
    for bitstream in wanted:
        bitstream.write(tmp_path)
    assert read_bitstreams(tmp_path, wanted) == {
        (3, "sobel"): wanted[0],
        (2, "sobel"): wanted[1],
        (3, "hash"): wanted[2],
    }


def test_a_file_that_is_missing(tmp_path: Path) -> None:
    path = tmp_path / SOBEL.file_name
    assert "cannot be read (No such file" in refusal(lambda: read_bitstreams(tmp_path, [SOBEL]), path)


@given(st.integers(0, SOBEL.size - 1))
def test_a_truncated_file(folder: Path, length: int) -> None:
    path = SOBEL.write(folder)
    path.write_bytes(path.read_bytes()[:length])
    expected = {f"has {length} bytes instead of 200.", "is not a bitstream of this project."}
    assert refusal(lambda: Bitstream.read(path), path) in expected


def test_a_truncated_body(tmp_path: Path) -> None:
    path = SOBEL.write(tmp_path)
    path.write_bytes(path.read_bytes()[:-1])
    assert refusal(lambda: Bitstream.read(path), path) == "has 199 bytes instead of 200."


def test_a_file_with_something_behind_it(tmp_path: Path) -> None:
    path = SOBEL.write(tmp_path)
    path.write_bytes(path.read_bytes() + b"\0")
    assert refusal(lambda: Bitstream.read(path), path) == "has 201 bytes instead of 200."


@given(st.integers(0, SOBEL.size - 1), st.integers(1, 255))
def test_a_flipped_byte_is_noticed_wherever_it_is(folder: Path, place: int, flips: int) -> None:
    path = SOBEL.write(folder)
    content = bytearray(path.read_bytes())
    content[place] ^= flips
    path.write_bytes(content)
    refusal(lambda: Bitstream.read(path), path)


@given(st.integers(0, SOBEL.size - 1), st.integers(1, 255))
def test_a_flipped_byte_in_the_body_or_the_name_is_called_damage(
    folder: Path, place: int, flips: int
) -> None:
    path = SOBEL.write(folder)
    content = bytearray(path.read_bytes())
    place = max(place, content.index(b"sobel"))
    content[place] ^= flips
    path.write_bytes(content)
    assert refusal(lambda: Bitstream.read(path), path) == "is damaged (CRC-32 differs)."


@given(st.binary(max_size=100))
def test_a_foreign_file(folder: Path, content: bytes) -> None:
    path = folder / "foreign.bit"
    path.write_bytes(content)
    assert refusal(lambda: Bitstream.read(path), path) == "is not a bitstream of this project."


def test_a_name_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / SOBEL.file_name
    header = struct.pack("<8sQIQ", b"RRZBIT02", 3, 5, 200)
    body = b"\xff" * 5 + bytes(163)
    path.write_bytes(header + struct.pack("<I", zlib.crc32(body, zlib.crc32(header))) + body)
    assert "holds callback" in refusal(lambda: read_bitstreams(tmp_path, [SOBEL]), path)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / SOBEL.file_name)
    with pytest.raises(FileError, match="it is a pipe"):
        read_bitstreams(tmp_path, [SOBEL])


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (Bitstream(2, "sobel", 200), "holds callback 'sobel' for slot 2, not 'sobel' for slot 3."),
        (Bitstream(3, "hash", 200), "holds callback 'hash' for slot 3, not 'sobel' for slot 3."),
        (Bitstream(3, "sobel", 300), "has 300 bytes; this slot takes 200."),
    ],
    ids=["slot", "callback", "size"],
)
def test_another_bitstream_renamed_into_its_place(tmp_path: Path, other: Bitstream, said: str) -> None:
    path = other.write(tmp_path / "elsewhere").rename(tmp_path / SOBEL.file_name)
    assert refusal(lambda: read_bitstreams(tmp_path, [SOBEL]), path) == said
