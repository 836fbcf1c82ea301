"""`reconros simulate`: a Compose file in one process in virtual time."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.cli.console import interrupted, new_table, wide_console
from reconros_zenoh.cli.options import AsJson, project_prints
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.cli.service_commands import read_deployment
from reconros_zenoh.cli.status_screen import print_status
from reconros_zenoh.experiments.deployment import DeploymentRun
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.provenance import own_folder
from reconros_zenoh.measure.statistics import format_ms

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Console


def simulate(
    file: Annotated[Path, typer.Option("--file", "-f", help="The Compose file.", show_default=False)],
    boards: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=10_000,
            metavar="N",
            help="Run N clones of the file's boards and clients, each on a network of its own.",
            show_default="those of the file",
        ),
    ] = None,
    requests: Annotated[
        int | None,
        typer.Option(min=1, help="Requests per client.", show_default="those of the file"),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=1e9,
            metavar="S",
            help="How long, in virtual time.",
            show_default="until all clients are done",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Seed of all boards and clients.", show_default="those of the file"),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the records.")] = Path(
        "results/simulate"
    ),
    as_json: AsJson = False,
) -> None:
    """Run the Compose file of `up` in virtual time, in one process.

    Without clients, as where timers of the boards do all, --seconds says how long. At the end it shows what
    the boards have done (of clones with --json only). The same seed gives the same records, bit for bit. Exit
    status 0 only if every answer was right and nothing was lost. Ctrl-C keeps what was measured.
    """
    plan = read_deployment(file, os.environ, has_end=seconds is not None).changed(requests, seed)
    with own_folder(out), project_prints(as_json=as_json):
        run = DeploymentRun([plan] if boards is None else [plan.clone(number) for number in range(boards)])
        with (
            run_bar(
                "virtual time", run.requests, quiet=as_json or not run.requests, each="request"
            ) as advance,
            until_interrupted() as interruption,
        ):
            run.run(advance, seconds)
        run.write_records(out)
    summaries, totals = run.summaries(), run.totals()
    simulated_s = run.simulated_ns / 1e9
    if as_json:
        facts = {"file": str(file), "simulated_s": simulated_s, "boards": summaries, "all_boards": totals}
        print(json.dumps(facts | {"status": run.statuses, "interrupted": interruption.happened}))
    else:
        console = wide_console()
        if summaries:
            _print_table(console, summaries | ({"all boards": totals} if len(summaries) > 1 else {}))
        if boards is None:
            for status in run.statuses.values():
                print_status(console, status)
                console.print()
        records = f"; the records are in {out}" if summaries else ""
        print(f"{simulated_s:.1f} s of virtual time{records}")
    if interruption.happened:
        raise interrupted(quiet=as_json)
    raise typer.Exit(0 if run.all_right() else 1)


def _print_table(console: Console, summaries: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> None:
    table = new_table(("board", "client"), ("n", "lost", "wrong", "median", "p95", "p99"))
    for board, services in summaries.items():
        for service, cell in services.items():
            table.add_row(
                Text(board),
                Text(service),
                str(cell["n"]),
                Text(str(cell["lost"]), style="red" if cell["lost"] else ""),
                Text(str(cell["wrong"]), style="red" if cell["wrong"] else ""),
                *(format_ms(cell[key]) for key in ("median_ms", "p95_ms", "p99_ms")),
            )
        table.add_section()
    console.print(table)
    console.print("Times in ms.", style="dim")
