"""Reading a text file of the project so that a failure names the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError

if TYPE_CHECKING:
    from pathlib import Path


def read_text_file(path: Path) -> str:
    """Return the text of a UTF-8 file with unified line ends; `FileError` if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FileError(
            path, None, f"The file cannot be read: {error.strerror}.", "Check the path and its permissions."
        ) from error
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise FileError(path, line, "The text is not UTF-8.", "Save the file as UTF-8.") from error
