"""Where the verbs print their tables, and how they end when they are interrupted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from reconros_zenoh.cli.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import ConsoleOptions, RenderableType

_COLUMNS = 80


class PlainConsole(Console):
    """A console on which names from elsewhere are only text: no markup, no emoji, no control characters."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Return what the console writes for a renderable."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(printable(segment.text), segment.style)


def wide_console(columns: int = _COLUMNS) -> PlainConsole:
    """Return stdout as a console that is never narrower than so many columns.

    The tables are laid out for 80. Squeezed into fewer they would lose digits; a narrow terminal breaks the
    lines itself and loses none.
    """
    console = PlainConsole()
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
