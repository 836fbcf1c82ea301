"""The standard streams of a command, whatever has become of them."""

from __future__ import annotations

import errno
import os
import sys
from io import BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


def open_streams() -> None:
    """Make the streams ones that can be used to the end of this process.

    What nobody reads or writes becomes /dev/null: a file that is opened later would get its number. A path
    may have letters that stdout has not. A terminal may close.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115 # until the end
        elif mode == "w" and isinstance(stream, TextIOWrapper) and stream.isatty():
            setattr(sys, name, _of_terminal(stream))
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")


def drop_output() -> None:
    """Let what is still to be written to stdout go nowhere: Python would complain at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Terminal(FileIO):
    """A terminal; what is written when it has closed goes nowhere.

    SIGHUP ends the process then, and comes sooner or later than the error, which would keep it from writing
    what it has measured.
    """

    def write(self, data: ReadableBuffer, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            return memoryview(data).nbytes


def _of_terminal(stream: TextIOWrapper) -> TextIOWrapper:
    return TextIOWrapper(
        BufferedWriter(_Terminal(stream.fileno(), "w", closefd=False)),
        stream.encoding,
        stream.errors,
        line_buffering=True,
    )
