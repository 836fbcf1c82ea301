"""`reconros experiment`: the experiments of the papers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.cli.console import interrupted, wide_console
from reconros_zenoh.cli.design import design
from reconros_zenoh.cli.driving import driving
from reconros_zenoh.cli.gateway_experiment import gateway
from reconros_zenoh.cli.options import AsJson, ClockName, Out, Profile, Seed
from reconros_zenoh.cli.progress import ExperimentProgress
from reconros_zenoh.cli.tables import callbacks, reconfiguration
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.provenance import own_folder
from reconros_zenoh.experiments.roundtrip import (
    BoardReport,
    Plan,
    all_right,
    application,
    finish,
    prepare,
)
from reconros_zenoh.measure.compare import print_tables
from reconros_zenoh.measure.findings import host_finding
from reconros_zenoh.measure.plots import write_grid
from reconros_zenoh.measure.run import load_run

if TYPE_CHECKING:
    from rich.console import Console

app = typer.Typer(help="Run an experiment of the papers on emulated boards.", no_args_is_help=True)
app.command("callbacks")(callbacks)
app.command("reconfiguration")(reconfiguration)
app.command("design")(design)
app.command("gateway")(gateway)
app.command("driving")(driving)

MAPPINGS = ("all_software", "mixed", "all_hardware")


@app.command("roundtrip")
def roundtrip(
    clock: Annotated[
        ClockName, typer.Option(help="Real time with processes, or virtual time.")
    ] = ClockName.WALL,
    mapping: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME|FILE", help="A mapping, may be repeated.", show_default=", ".join(MAPPINGS)
        ),
    ] = None,
    requests: Annotated[int, typer.Option(min=1, help="Requests per client.")] = 100,
    seed: Seed = 0,
    out: Out = Path("results"),
    profile: Profile = "miniitx-zynq7100",
    as_json: AsJson = False,
) -> None:
    """Section V-C: round trips of five clients.

    Under each mapping, beside those of the real board. Writes the records, experiment.json and
    roundtrips.png, the histograms of Fig. 6.

    Exit status 0 only if every answer was right and nothing was lost.
    """
    planned = plan(clock, mapping or MAPPINGS, requests, seed, out, profile)
    experiment = run(planned, quiet=as_json)
    if not as_json:
        show(wide_console(), experiment)
        print(f"records and experiment.json are in {planned.folder}")
    if experiment["mappings"]:
        write_grid(planned.drawing, load_run(planned.folder)[1])
        if not as_json:
            print(f"drawn to {planned.drawing}")
    if as_json:
        print(json.dumps(experiment))
    if experiment["interrupted"]:
        raise interrupted(quiet=as_json, measured=bool(experiment["mappings"]))
    raise typer.Exit(0 if all_right(experiment) else 1)


def plan(
    clock: ClockName, mappings: tuple[str, ...] | list[str], requests: int, seed: int, out: Path, profile: str
) -> Plan:
    """Return the plan of an experiment; raise UsageError for a mapping or profile that cannot be used."""
    from reconros_zenoh.board.profile import read_profile
    from reconros_zenoh.experiments.simulation import check_hosting

    board = read_profile(profile)
    if board.model is None and clock is ClockName.VIRTUAL:
        raise UsageError(
            f"profile {profile!r} models nothing, so nothing would take any virtual time. Use --clock wall."
        )
    project = application()
    named: dict[str, Path] = {}
    for given, (name, read) in zip(mappings, project.mappings(mappings).items(), strict=True):
        path = project.mapping_path(given)
        if name in project.mapping_files() and read != project.mapping(name):
            raise UsageError(
                f"{path} is not the mapping {name!r} that the real board ran. Rename the file: the name says "
                "which of its times stand beside ours."
            )
        check_hosting(board, project, read)
        named[name] = path.resolve()
    return Plan(clock.value, named, requests, seed, profile, out)


def show(console: Console, experiment: dict[str, Any]) -> None:
    """Print the experiment's tables, and of wall time whether the host kept up."""
    print_tables(console, experiment)
    if experiment["clock"] == "wall":
        host = host_finding(experiment)
        console.print(Text(f"host: {host.sentence}", style="yellow" if host.warning else ""))


def run(plan: Plan, *, quiet: bool) -> dict[str, Any]:
    """Run the experiment and return its object; Ctrl-C keeps what was measured and marks it interrupted."""
    report = BoardReport()
    with own_folder(plan.folder):
        prepare(plan)
        with ExperimentProgress(plan, quiet=quiet) as progress, until_interrupted() as interruption:
            if plan.clock == "virtual":
                from reconros_zenoh.experiments.roundtrip_virtual import run_virtual

                run_virtual(plan, report, progress.advance)
            else:
                from reconros_zenoh.experiments.roundtrip_wall import run_wall

                run_wall(plan, report, progress.advance)
        return finish(plan, report, interrupted=interruption.happened)
