"""Where the verbs print their tables, and how they end when they are interrupted."""

from __future__ import annotations

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

_COLUMNS = 80


def wide_console(columns: int = _COLUMNS) -> Console:
    """Return stdout as a console that is never narrower than so many columns.

    The tables are laid out for 80. Squeezed into fewer they would lose digits; a narrow terminal breaks the
    lines itself and loses none.
    """
    console = Console()
    console.width = max(console.width, columns)
    return console


def titled_table(title: str, padding: int = 0) -> Table:
    """Return a table without columns under its title, with so many blanks behind each column."""
    return Table(
        title=Text(title, style="bold"),
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, padding, 0, 0),
        show_edge=False,
    )


def interrupted(*, quiet: bool, measured: bool = True) -> typer.Exit:
    """Return the end of a verb that a signal stopped, status 130; it has said so unless `quiet`."""
    if not quiet:
        print(f"interrupted before {'its end' if measured else 'anything was measured'}")
    return typer.Exit(130)
