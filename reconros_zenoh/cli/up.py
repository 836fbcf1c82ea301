"""`reconros up` and `reconros down`: a Compose file as local processes."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path  # typer reads the annotations at run time
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from deploy.compose import read_compose
from deploy.state import StateFolder, running
from deploy.supervisor import start_supervisor, supervise
from reconros_zenoh.cli.console import PlainConsole
from reconros_zenoh.cli.service_screen import ServiceScreen
from reconros_zenoh.errors import ExperimentError, FileError, UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

_File = Annotated[Path, typer.Option("--file", "-f", help="The Compose file.", show_default=False)]
_AsJson = Annotated[bool, typer.Option("--json", help="Print the final states as JSON and nothing else.")]


def up(
    file: _File,
    detach: Annotated[
        bool, typer.Option("--detach", "-d", help="Return when all are healthy and leave them running.")
    ] = False,
    as_json: _AsJson = False,
) -> None:
    """Run the services of a Compose file as local processes.

    It ends when all of them have ended, or on Ctrl-C.
    """
    environment = dict(os.environ)
    deployment = read_compose(file, environment)
    folder = StateFolder(file, environment)
    console = _console(quiet=as_json)
    screen = ServiceScreen(console, deployment.services, None if detach or as_json else folder.logs)
    failure: ExperimentError | typer.Exit | None = None
    error = ""
    try:
        with screen:
            if detach:
                start_supervisor(file, folder, environment, screen.show)
            else:
                supervise(deployment, folder, environment, screen.show)
    except (KeyboardInterrupt, SystemExit):  # the latter is SIGTERM or SIGHUP (`EndingSignals`)
        failure, error = typer.Exit(130), "interrupted"
    except ExperimentError as caught:
        failure, error = caught, str(caught)
    if as_json:
        _print_json(file, folder, screen.states, error)
        if isinstance(failure, ExperimentError):
            print(f"reconros: {error}", file=sys.stderr)
            failure = typer.Exit(1)  # raised, it would be a second object
    if failure is not None:
        raise failure
    if detach:
        stop = f"reconros down -f {quote(str(file))}"
        console.print(f"{file} is up, its logs are in {folder.logs}. Stop it with: {stop}")


def down(
    file: Annotated[
        Path | None,
        typer.Option("--file", "-f", help="The Compose file.", show_default="the one that is running"),
    ] = None,
    as_json: _AsJson = False,
) -> None:
    """Stop what `reconros up` has started."""
    file = file or _the_one_running()
    folder = StateFolder(file, os.environ) if file else None
    record = folder.end_owner() if folder else None
    if file and record is None and not file.exists():  # of a file that is gone the deployment may still run
        raise FileError(file, None, "is not there, and nothing of it is running.", "Correct the name.")
    if as_json:
        states, error = (record.states, record.error) if record else ({}, "")
        _print_json(file, folder, states, error)
        return
    console = _console(quiet=False)
    if record is None:
        console.print(f"Nothing of {file} is running." if file else "Nothing is running.")
        return
    for service, state in record.states.items():
        console.print(f"{service}: {state}")
    if record.error:
        console.print(f"It had failed before: {record.error}")


def _console(*, quiet: bool) -> PlainConsole:
    return PlainConsole(highlight=False, soft_wrap=True, quiet=quiet)


def _the_one_running() -> Path | None:
    files = running(os.environ)
    if len(files) > 1:
        which = " or ".join(f"-f {file}" for file in files)
        raise UsageError(f"{len(files)} Compose files are up. Say which one is to stop: {which}")
    return files[0] if files else None


def _print_json(file: Path | None, folder: StateFolder | None, states: Mapping[str, str], error: str) -> None:
    """Print the outcome; without a file nothing was running."""
    logs = None if folder is None else str(folder.logs)
    print(json.dumps({"file": file and str(file), "logs": logs, "services": states, "error": error}))
