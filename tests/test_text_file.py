"""Files that somebody gave: whatever they are, the answer is their text or a FileError, and comes at once."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.errors import FileError
from reconros_zenoh.text_file import read_old_text_file, read_text_file, replacing

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "given.txt"


@pytest.mark.parametrize("content", [b"a\nb\n", b"a\r\nb\r\n", b"a\rb\r", b"\xef\xbb\xbfa\nb\n"])
def test_line_ends_and_byte_order_mark_do_not_matter(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    assert read_text_file(path) == read_old_text_file(path, []) == "a\nb\n"


def refusal(path: Path, **more: int) -> str:
    with pytest.raises(FileError) as caught:
        read_text_file(path, "Give another.", **more)
    assert caught.value.remedy
    return str(caught.value)


def test_what_is_not_there_or_a_folder(path: Path, tmp_path: Path) -> None:
    assert refusal(path) == f"{path}: cannot be read: No such file or directory. Give another."
    assert refusal(tmp_path) == f"{tmp_path}: cannot be read: Is a directory. Give another."


def test_a_link_to_itself(path: Path) -> None:
    path.symlink_to(path)
    assert "Too many levels of symbolic links" in refusal(path)


def test_a_pipe_that_nobody_writes_to_is_not_waited_for(path: Path) -> None:
    os.mkfifo(path)
    assert "a pipe or a device" in refusal(path)


def test_a_device_that_never_ends(path: Path) -> None:
    path.symlink_to("/dev/zero")
    assert "a pipe or a device" in refusal(path)


def test_a_file_over_the_limit(path: Path) -> None:
    path.write_bytes(b"12345")
    assert read_text_file(path, limit_bytes=5) == "12345"
    assert "it has 0.0 MB, and 4e-06 MB is the limit" in refusal(path, limit_bytes=4)
    with path.open("wb") as file:
        file.truncate(2_000_000)
    assert "it has 2.0 MB, and 1 MB is the limit" in refusal(path)


def test_what_is_not_utf_8_is_named_by_its_line(path: Path) -> None:
    path.write_bytes(b"a\nb\xff\n")
    assert refusal(path) == f"{path}:2: The text is not UTF-8. Save the file as UTF-8."


def test_an_error_quotes_no_whole_file(path: Path) -> None:
    error = FileError(path, 7, f"{'x' * 1_000_000!r} is not a time in ms.")
    assert len(error.problem) < 700
    assert error.problem.endswith("x' is not a time in ms.")


def test_a_file_is_replaced_by_a_complete_one(path: Path) -> None:
    path.write_text("old")
    with replacing(path) as partial:
        partial.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(path.parent.iterdir()) == [path]


def test_of_a_file_that_could_not_be_written_nothing_is_left(path: Path) -> None:
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError), replacing(path) as partial:
        partial.write_text("new \N{SNOWMAN}", encoding="latin-1")
    assert path.read_text() == "old"
    assert list(path.parent.iterdir()) == [path]
