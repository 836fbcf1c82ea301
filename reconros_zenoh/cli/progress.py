"""How far an experiment is: bars on a terminal, lines elsewhere.

A terminal without cursor movement (TERM=dumb) is `elsewhere`: bars that cannot be redrawn show nothing.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from reconros_zenoh.cli.console import PlainConsole
from reconros_zenoh.experiments.roundtrip import CLIENTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from reconros_zenoh.experiments.roundtrip import Plan


class ExperimentProgress:
    """Shows the round trips of the mapping that runs; writes to stderr, nothing when quiet."""

    def __init__(self, plan: Plan, *, quiet: bool) -> None:
        self._plan = plan
        self._console = PlainConsole(stderr=True, quiet=quiet)
        self._bars = _bars(self._console)
        self._tasks = {client: self._bars.add_task(client, total=plan.requests) for client in CLIENTS}
        self._left = 0
        self._mapping = ""

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def advance(self, mapping: str, client: str) -> None:
        """Count one round trip of a client under a mapping."""
        if mapping != self._mapping:
            self._mapping = mapping
            self._left = self._plan.requests * len(CLIENTS)
            for name, task in self._tasks.items():
                self._bars.reset(task, description=f"{mapping}  {name}")
            if not self._console.is_interactive:
                self._console.print(f"{self._plan.clock} time, {mapping}: {self._left} round trips ...")
        self._bars.advance(self._tasks[client])
        self._left -= 1
        if not self._left and not self._console.is_interactive:
            self._console.print(f"{self._plan.clock} time, {mapping}: done")


@contextmanager
def run_bar(what: str, runs: int, *, quiet: bool, each: str = "run") -> Iterator[Callable[[], None]]:
    """Show how many of the runs are done while the block runs; it calls what it is given after each."""
    console = PlainConsole(stderr=True, quiet=quiet)
    if not console.is_interactive:
        console.print(f"{what}: {runs} {each}{'s' * (runs != 1)} ...")
    with _bars(console) as bars:
        yield partial(bars.advance, bars.add_task(what, total=runs))


def _bars(console: PlainConsole) -> Progress:
    """Return bars that show nothing where they cannot be redrawn."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        disable=console.quiet or not console.is_interactive,
    )
