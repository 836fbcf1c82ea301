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


def new_table(
    names: Iterable[str] = (), figures: Iterable[str] = (), *, title: str = "", padding: int = 0
) -> Table:
    """Return a table without rows: columns of names, folded if need be, then of figures, which never are.

    `padding` is the number of blanks behind each column.
    """
    table = Table(
        title=Text(title, style="bold") if title else None,
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, padding, 0, 0),
        show_edge=False,
    )
    # As text: a unit in brackets is no markup.
    for name in names:
        table.add_column(Text(name), overflow="fold")
    for figure in figures:
        table.add_column(Text(figure), justify="right", no_wrap=True)
    return table


def print_rows(
    console: Console, columns: Iterable[str], rows: Iterable[Iterable[object]], *, title: str = ""
) -> None:
    """Print a table and an empty line unless there are no rows.

    Columns of numbers stand to the right; numbers with a fraction are ms, and what is not there is a `-`.
    """
    content = [list(row) for row in rows]
    if not content:
        return
    table = new_table(title=title, padding=1)
    for index, column in enumerate(columns):
        numbers = all(isinstance(row[index], int | float | None) for row in content)
        table.add_column(Text(column), justify="right" if numbers else "left", overflow="fold")
    for row in content:
        table.add_row(*(Text(_cell(value)) for value in row))
    console.print(table, highlight=False)
    console.print()


def _cell(value: object) -> str:
    if value is None or value == "":
        return "-"
    return short_ms(value) if isinstance(value, float) else str(value)


def short_ms(value: float) -> str:
    """Return a time in ms with about three digits."""
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def interrupted(*, quiet: bool, measured: bool = True) -> typer.Exit:
    """Return the end of a verb that a signal stopped, status 130; it has said so unless `quiet`."""
    if not quiet:
        print(f"interrupted before {'its end' if measured else 'anything was measured'}")
    return typer.Exit(130)
