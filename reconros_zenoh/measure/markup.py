"""The tables of the report in HTML."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

Cell = str | tuple[str, str]
"""A text, or a text and the style class of its cell."""


def table(head: Iterable[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Return a table with these texts, which are never taken for markup."""
    lines = ["<tr>" + "".join(f"<th>{escape(text)}</th>" for text in head) + "</tr>"]
    for row in rows:
        cells = [(cell, "") if isinstance(cell, str) else cell for cell in row]
        lines.append(
            "<tr>" + "".join(f'<td class="{style}">{escape(text)}</td>' for text, style in cells) + "</tr>"
        )
    return '<div class="wide"><table>' + "\n".join(lines) + "</table></div>"
