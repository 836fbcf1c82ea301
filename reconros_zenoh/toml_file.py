"""A TOML file that knows in which line a key stands."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import FileError
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


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
        try:
            return cls(path, tomllib.loads(text), text)
        except tomllib.TOMLDecodeError as error:
            found = re.search(r"at line (\d+)", str(error))
            line = int(found[1]) if found else text.count("\n") + 1
            raise FileError(path, line, f"is not TOML: {error}.", "Correct the syntax.") from None

    def line(self, key: Sequence[str]) -> int | None:
        """Return the line of a key given as its path of tables and names, or of its nearest enclosing table.

        The standard parser keeps no positions, so the text is searched: for the header of the innermost
        table, then for the assignment below it.
        """
        lines = self.text.splitlines()
        for depth in range(len(key), -1, -1):
            start = _find_header(lines, key[:depth])
            if start is None:
                continue
            end = next((i for i in range(start, len(lines)) if lines[i].lstrip().startswith("[")), len(lines))
            for index in range(start, end):
                name = lines[index].split("=", 1)[0].strip().strip("\"'")
                if depth < len(key) and (name == key[depth] or name.startswith(f"{key[depth]}.")):
                    return index + 1
            if depth:
                return start
        return None


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


def _headers(lines: Sequence[str], tables: Sequence[str]) -> list[int]:
    """Return the indices of the lines below each header of that name."""
    name = ".".join(tables)
    return [
        index + 1
        for index, line in enumerate(lines)
        if line.strip().startswith("[")
        and line.split("#", 1)[0].strip().strip("[] ").replace('"', "") == name
    ]
