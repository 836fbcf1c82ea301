"""Where the verbs print their tables."""

from __future__ import annotations

from rich.console import Console

_COLUMNS = 80


def wide_console(columns: int = _COLUMNS) -> Console:
    """Return stdout as a console that is never narrower than so many columns.

    The tables are laid out for 80. Squeezed into fewer they would lose digits; a narrow terminal breaks the
    lines itself and loses none.
    """
    console = Console()
    console.width = max(console.width, columns)
    return console
