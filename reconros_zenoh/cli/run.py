"""`reconros run`: a project on a board of the kind that it is built for."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconros_zenoh.board.status import status
from reconros_zenoh.cli.console import interrupted, wide_console
from reconros_zenoh.cli.options import (
    ENDPOINT,
    AsJson,
    Bitstreams,
    BoardName,
    ClockName,
    Domain,
    MappingName,
    ModelSeed,
    ProjectProfile,
    Router,
    TraceFile,
    project_prints,
)
from reconros_zenoh.cli.status_screen import print_status
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project

if TYPE_CHECKING:
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import ProjectMapping

_VIRTUAL_S = 10.0


def run(
    project: Annotated[Path, typer.Argument(help="Folder of a ReconROS project.")],
    mapping: MappingName = None,
    profile: ProjectProfile = None,
    clock: Annotated[
        ClockName, typer.Option(help="Real time, with a router; or virtual time, in this process alone.")
    ] = ClockName.WALL,
    seconds: Annotated[
        float | None,
        typer.Option(
            min=0.001, max=1e9, help="How long.", show_default=f"until Ctrl-C, in virtual time {_VIRTUAL_S:g}"
        ),
    ] = None,
    name: BoardName = "board0",
    router: Router = ENDPOINT,
    domain: Domain = 0,
    seed: ModelSeed = 0,
    bitstreams: Bitstreams = None,
    trace: TraceFile = None,
    as_json: AsJson = False,
) -> None:
    """Run a project on an emulated board of its TargetBoard.

    At the end, or at Ctrl-C, it shows what the board has done.
    """
    with project_prints(as_json=as_json):
        loaded = load_project(project)
        model = loaded.profile(profile)
        mapped = loaded.mapping(mapping)
        options = BoardOptions(name, domain, seed, bitstreams, trace=trace)
        if clock is ClockName.VIRTUAL:
            seconds = seconds or _VIRTUAL_S
            done = _run_virtual(model, loaded, mapped, options, seconds)
        else:
            from board_daemon.daemon import run_board

            def on_ready() -> None:
                if not as_json:
                    print(
                        f"board {name} serves {loaded.configuration.name} under {mapped.name} "
                        f"on {model.name}",
                        flush=True,
                    )

            done = run_board(router, model, loaded, mapped, options, on_ready, seconds)
    early = seconds is not None and done["elapsed_ms"] < round(seconds * 1e9) / 1e6
    if as_json:
        print(json.dumps(done | {"interrupted": early}))
    else:
        print_status(wide_console(), done)
        if model.model is None and clock is ClockName.VIRTUAL:
            print(
                f"{model.name} models nothing, so nothing took any time. --profile chooses a board that does."
            )
        if trace:
            print(f"what ran where and when is in {trace}")
    if early:
        raise interrupted(quiet=as_json)


def _run_virtual(
    profile: Profile, project: Project, mapping: ProjectMapping, options: BoardOptions, seconds: float
) -> dict[str, Any]:
    """Return the status of the board after so many seconds of virtual time, or at Ctrl-C."""
    from reconros_zenoh.experiments.simulation import Simulation

    with Simulation(project.types()) as simulation:
        hosted = simulation.add_board(profile, project, mapping, options)
        with suppress(KeyboardInterrupt):
            simulation.environment.run(until=round(seconds * 1e9))
        return status(hosted.board, hosted.executor)
