"""Text files: reading those that somebody gave, without waiting for what never ends; and replacing them."""

from __future__ import annotations

import stat
from contextlib import contextmanager
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_LIMIT_BYTES = 1_000_000
"""No file that people write is larger, and one of YAML takes seconds to read at this size."""

_REMEDY = "Check the path and its permissions."


def read_text_file(path: Path, remedy: str = _REMEDY, limit_bytes: int = _LIMIT_BYTES) -> str:
    """Return the text of a UTF-8 file with unified line ends; `FileError` if it cannot be read.

    `remedy` is said where there is no such file, or one that is larger than the limit or no file: a pipe may
    never end.
    """
    content = _read(path, remedy, limit_bytes)
    try:
        return _unified(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FileError(
            path, _line(content, error.start), "The text is not UTF-8.", "Save the file as UTF-8."
        ) from error


def read_old_text_file(path: Path, warnings: list[str]) -> str:
    """Return the text like `read_text_file`; what is not UTF-8 is read as Windows-1252, with a warning."""
    content, encoding = read_old_bytes(path, warnings)
    return _unified(content.decode(encoding, errors="replace").removeprefix("\ufeff"))


def read_old_bytes(path: Path, warnings: list[str]) -> tuple[bytes, str]:
    """Return what is in a text file and its encoding: UTF-8, or Windows-1252 with a warning."""
    content = _read(path, _REMEDY, _LIMIT_BYTES)
    zero = content.find(b"\0")
    if zero >= 0:
        raise FileError(path, _line(content, zero), "The file is no text.", "Save it as UTF-8.")
    try:
        content.decode()
    except UnicodeDecodeError as error:
        warnings.append(
            f"{path}:{_line(content, error.start)}: this is not UTF-8; it is read as Windows-1252."
        )
        return content, "cp1252"
    return content, "utf-8"


def check_file(path: Path, remedy: str, limit_bytes: int) -> None:
    """Raise FileError unless there is a file, of at most so many bytes, or a folder; OSError without any."""
    status = path.stat()
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise FileError(path, None, "cannot be read: it is a pipe or a device.", remedy)
    if stat.S_ISREG(status.st_mode) and status.st_size > limit_bytes:
        size, limit = status.st_size / 1e6, limit_bytes / 1e6
        raise FileError(
            path, None, f"cannot be read: it has {size:.1f} MB, and {limit:g} MB is the limit.", remedy
        )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a file to write; it becomes `path` if the block ends well, otherwise nothing is left of it.

    So nobody reads half of a file, and an older one stays until it is replaced.
    """
    partial = path.with_name(f"{path.name}.partial")
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _read(path: Path, remedy: str, limit_bytes: int) -> bytes:
    try:
        check_file(path, remedy, limit_bytes)
        return path.read_bytes()
    except OSError as error:
        raise FileError(path, None, f"cannot be read: {error.strerror}.", remedy) from error


def _unified(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _line(content: bytes, position: int) -> int:
    return content.count(b"\n", 0, position) + 1
