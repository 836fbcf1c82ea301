"""The log files of the services: their last lines, and their new lines while they grow."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_TAIL_BYTES = 64 * 1024


def last_lines(file: BinaryIO, count: int) -> list[str]:
    """Return the last lines of a file, looking at its last 64 KiB only."""
    file.seek(0, 2)
    file.seek(max(0, file.tell() - _TAIL_BYTES))
    return file.read().decode(errors="replace").splitlines()[-count:]


class LogReader:
    """Reads a growing log line by line; a line that has no end yet is left for the next time."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0

    def new_lines(self, *, all_of_it: bool = False) -> Iterator[str]:
        """Yield what was written since the last time; `all_of_it` takes an unfinished last line too."""
        with self._path.open("rb") as file:
            file.seek(self._offset)
            for line in file:
                if not line.endswith(b"\n") and not all_of_it:
                    return
                self._offset += len(line)
                yield line.decode(errors="replace").rstrip("\r\n")
