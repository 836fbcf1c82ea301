"""A TOML file that knows in which line a key stands."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_left
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import FileError
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

UNKNOWN_KEY = "extra_forbidden"
"""What pydantic calls a key that there is not."""

# What the parser raises but for its own error; both are limits of Python.
_BEYOND: dict[type[Exception], str] = {
    RecursionError: "is nested too deeply.",
    ValueError: "has a number of thousands of digits.",
}
# For a key a.b.c... the parser takes memory and time that grow with the square of its length.
_ENDLESS_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]+[ \t]*\.[ \t]*){100}""")


@dataclass(frozen=True, slots=True)
class TomlFile:
    """The content of a TOML file and its text."""

    path: Path
    content: dict[str, Any]
    text: str

    @classmethod
    def read(cls, path: Path) -> TomlFile:
        """Return the file; raise FileError with the line when it cannot be read or is not TOML."""
        text = read_text_file(path, "Give a readable TOML file.")
        if found := _ENDLESS_KEY.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise FileError(path, line, _BEYOND[RecursionError], "Correct it.")
        try:
            return cls(path, tomllib.loads(text), text)
        except tomllib.TOMLDecodeError as error:
            found = re.search(r"at line (\d+)", str(error))
            line = int(found[1]) if found else text.count("\n") + 1
            raise FileError(path, line, f"is not TOML: {error}.", "Correct the syntax.") from None
        except (RecursionError, ValueError) as error:
            raise FileError(
                path, _guilty_line(text, type(error)), _BEYOND[type(error)], "Correct it."
            ) from None

    def line(self, key: Sequence[str]) -> int | None:
        """Return the line of a key given as its path of tables and names, or of its nearest enclosing table.

        The standard parser keeps no positions, so the text is searched: for the header of the innermost
        table, then for the assignment below it.
        """
        lines = self.text.splitlines()
        for depth in range(len(key), -1, -1):
            start = _find_header(lines, key[:depth])
            if start is None:
                # A table need not have a header of its own beside those of tables in it.
                within = _headers(lines, key[:depth], exact=False)
                if within:
                    return within[0]
                continue
            end = next((i for i in range(start, len(lines)) if lines[i].lstrip().startswith("[")), len(lines))
            for index in range(start, end):
                name = lines[index].split("=", 1)[0].strip().strip("\"'")
                if depth < len(key) and (name == key[depth] or name.startswith(f"{key[depth]}.")):
                    return index + 1
            if depth:
                return start
        return None


def first_mistake(error: ValidationError) -> ErrorDetails:
    """Return the mistake to tell of.

    A misspelt key is an unknown one and a missing one: the unknown one stands in the file.
    """
    return min(error.errors(), key=lambda mistake: mistake["type"] != UNKNOWN_KEY)


def _find_header(lines: Sequence[str], tables: Sequence[str]) -> int | None:
    """Return the index of the first line below the header `[a.b]`, 0 for the top table, None when absent.

    A number at the end picks among the headers `[[a.b]]` of an array of tables.
    """
    if not tables:
        return 0
    *array, last = tables
    found = _headers(lines, tables)[:1] or (
        _headers(lines, array)[int(last) :][:1] if last.isdecimal() else []
    )
    return found[0] if found else None


def _headers(lines: Sequence[str], tables: Sequence[str], *, exact: bool = True) -> list[int]:
    """Return the indices of the lines below each header of that name, or else of tables in it."""
    name = ".".join(tables)
    headers = [
        (index + 1, line.split("#", 1)[0].strip().strip("[] ").replace('"', ""))
        for index, line in enumerate(lines)
        if line.strip().startswith("[")
    ]
    return [
        index for index, header in headers if (header == name if exact else header.startswith(f"{name}."))
    ]


def _guilty_line(text: str, kind: type[Exception]) -> int:
    """Return up to which line the text must be read for an error of this kind."""

    def fails(last: int) -> bool:
        try:
            tomllib.loads("\n".join(lines[:last]))
        except (RecursionError, ValueError) as error:
            return type(error) is kind
        return False

    lines = text.split("\n")
    return bisect_left(range(len(lines) + 1), True, key=fails)
