"""Reading a text file of the project so that a failure names the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError

if TYPE_CHECKING:
    from pathlib import Path


def read_text_file(path: Path) -> str:
    """Return the text of a UTF-8 file with unified line ends; `FileError` if it cannot be read."""
    content = _read(path)
    try:
        return _unified(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FileError(
            path, _line(content, error.start), "The text is not UTF-8.", "Save the file as UTF-8."
        ) from error


def read_old_text_file(path: Path, warnings: list[str]) -> str:
    """Return the text like `read_text_file`; what is not UTF-8 is read as Windows-1252, with a warning."""
    content = _read(path)
    zero = content.find(b"\0")
    if zero >= 0:
        raise FileError(path, _line(content, zero), "The file is no text.", "Save it as UTF-8.")
    try:
        return _unified(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        warnings.append(
            f"{path}:{_line(content, error.start)}: this is not UTF-8; it is read as Windows-1252."
        )
        return _unified(content.decode("cp1252", errors="replace"))


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileError(
            path, None, f"The file cannot be read: {error.strerror}.", "Check the path and its permissions."
        ) from error


def _unified(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _line(content: bytes, position: int) -> int:
    return content.count(b"\n", 0, position) + 1
