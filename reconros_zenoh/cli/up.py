"""`reconros up` and `reconros down`: a Compose file as local processes."""

from __future__ import annotations

import itertools
import json
import os
import threading
from contextlib import nullcontext
from pathlib import Path  # typer reads the annotations at run time
from typing import TYPE_CHECKING, Annotated, Self

import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text

from deploy.compose import read_compose
from deploy.logs import LogReader
from deploy.service_run import ServiceState
from deploy.state import StateFolder
from deploy.supervisor import start_supervisor, supervise
from reconros_zenoh.errors import ExperimentError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

_COLOURS = ("cyan", "yellow", "green", "magenta", "blue", "bright_cyan", "bright_yellow", "bright_green")
_BAD = {ServiceState.UNHEALTHY, ServiceState.FAILED}
_OVER = {ServiceState.ENDED, ServiceState.FAILED, ServiceState.STOPPED}
_READ_INTERVAL_S = 0.1

_File = Annotated[Path, typer.Option("--file", "-f", help="The Compose file.", show_default=False)]
_AsJson = Annotated[bool, typer.Option("--json", help="Print the final states as JSON and nothing else.")]


def up(
    file: _File,
    detach: Annotated[
        bool, typer.Option("--detach", "-d", help="Return when all are healthy and leave them running.")
    ] = False,
    as_json: _AsJson = False,
) -> None:
    """Run the services of a Compose file as local processes until all have ended, or until Ctrl-C."""
    environment = dict(os.environ)
    deployment = read_compose(file, environment)
    folder = StateFolder(file, environment)
    console = _console(quiet=as_json)
    screen = _Screen(console, deployment.services, None if detach or as_json else folder.logs)
    failure: ExperimentError | typer.Exit | None = None
    error = ""
    try:
        with screen:
            if detach:
                start_supervisor(file, folder, environment, screen.show)
            else:
                supervise(deployment, folder, environment, screen.show)
    except KeyboardInterrupt:
        failure, error = typer.Exit(130), "interrupted"
    except ExperimentError as caught:
        failure, error = caught, str(caught)
    if as_json:
        _print_json(file, folder, screen.states, error)
    if failure is not None:
        raise failure
    if detach:
        console.print(f"{file} is up, its logs are in {folder.logs}. Stop it with: reconros down -f {file}")


def down(file: _File, as_json: _AsJson = False) -> None:
    """Stop what `reconros up` of this Compose file has started."""
    folder = StateFolder(file, os.environ)
    record = folder.end_owner()
    if as_json:
        _print_json(
            file, folder, {} if record is None else record.states, "" if record is None else record.error
        )
        return
    console = _console(quiet=False)
    if record is None:
        console.print(f"Nothing of {file} is running.")
        return
    for service, state in record.states.items():
        console.print(f"{service}: {state}")
    if record.error:
        console.print(f"It had failed before: {record.error}")


class _Screen:
    """Shows the states of the services and, with `logs`, the new lines of their logs.

    On a terminal the states stand below the lines and change in place, elsewhere each change is a line. The
    logs are read from their files at short intervals: the services write them without us, so that a slow
    terminal can never hold up an experiment.
    """

    def __init__(self, console: Console, services: Iterable[str], logs: Path | None) -> None:
        self.states = dict.fromkeys(services, ServiceState.WAITING)
        self._console = console
        self._logs = logs
        self._readers: dict[str, LogReader] = {}
        self._styles = dict(zip(self.states, itertools.cycle(_COLOURS), strict=False))
        self._width = max(map(len, self.states), default=0)
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._follower = threading.Thread(target=self._follow, name="follow logs", daemon=True)
        self._live = (
            Live(console=console, get_renderable=self._status) if console.is_terminal else nullcontext()
        )

    def __enter__(self) -> Self:
        self._live.__enter__()
        self._follower.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._over.set()
        self._follower.join()
        self._live.__exit__(None, None, None)

    def show(self, service: str, state: ServiceState) -> None:
        """Take in a new state of a service."""
        with self._lock:
            if self._logs is not None and state is ServiceState.STARTED:
                self._readers[service] = LogReader(self._logs / f"{service}.log")
            if state in _OVER:
                self._print_new_lines(service, all_of_it=True)
            self.states[service] = state
            if not self._console.is_terminal:
                self._console.print(f"{service}: {state}")

    def _follow(self) -> None:
        while not self._over.wait(_READ_INTERVAL_S):
            with self._lock:
                for service in self._readers:
                    self._print_new_lines(service, all_of_it=False)

    def _print_new_lines(self, service: str, *, all_of_it: bool) -> None:
        if service in self._readers:
            for line in self._readers[service].new_lines(all_of_it=all_of_it):
                prefix = Text(f"{service:{self._width}} | ", style=self._styles[service])
                self._console.print(prefix + Text.from_ansi(line))

    def _status(self) -> Text:
        lines = Text()
        for service, state in self.states.items():
            lines.append(f"{service:{self._width}}  ", self._styles[service])
            lines.append(f"{state}\n", "red" if state in _BAD else "")
        return lines


def _console(*, quiet: bool) -> Console:
    return Console(highlight=False, markup=False, emoji=False, soft_wrap=True, quiet=quiet)


def _print_json(file: Path, folder: StateFolder, states: Mapping[str, str], error: str) -> None:
    print(json.dumps({"file": str(file), "logs": str(folder.logs), "services": states, "error": error}))
