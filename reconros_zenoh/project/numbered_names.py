"""Names with numbers behind them: `slot(*)`, `slot(0)`, `slot(0:3)`."""

from __future__ import annotations

import re
from dataclasses import dataclass

_MOST_NUMBERS = 1000
_NAME = re.compile(
    r"(?P<name>[^\s,()@]+)"
    r"(?:\s*\(\s*(?:(?P<star>\*)|(?P<first>[0-9]{1,9})\s*(?::\s*(?P<last>[0-9]{1,9})\s*)?)\s*\))?"
    r"(?:[\s,]+|\Z)"
)


@dataclass(frozen=True)
class NumberedName:
    """A name and the numbers in its parentheses; `numbers` is None without parentheses and for `(*)`."""

    name: str
    numbers: range | None = None
    every: bool = False


def parse_numbered_names(text: str) -> list[NumberedName]:
    """Return the names of a list separated by commas and/or blanks; ValueError says what cannot be read."""
    names: list[NumberedName] = []
    position = 0
    while position < len(text):
        match = _NAME.match(text, position)
        if match is None:
            raise ValueError(f"{text[position:]!r} is no `name`, `name(*)`, `name(0)` or `name(0:3)`.")
        names.append(_numbered_name(match))
        position = match.end()
    return names


def _numbered_name(match: re.Match[str]) -> NumberedName:
    if match["star"]:
        return NumberedName(match["name"], every=True)
    if match["first"] is None:
        return NumberedName(match["name"])
    first = int(match["first"])
    last = int(match["last"] or first)
    if last < first:
        raise ValueError(f"The range {match['name']}({first}:{last}) runs backwards.")
    if last - first >= _MOST_NUMBERS:
        raise ValueError(f"The range {match['name']}({first}:{last}) is longer than {_MOST_NUMBERS}.")
    return NumberedName(match["name"], range(first, last + 1))
