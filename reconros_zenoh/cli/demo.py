"""`reconros demo`: the main job from beginning to end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from reconros_zenoh.cli.experiment import MAPPINGS, ClockName, Out, plan, run
from reconros_zenoh.experiments.roundtrip import all_right
from reconros_zenoh.measure.compare import print_tables
from reconros_zenoh.measure.report import write_report
from reconros_zenoh.measure.run import load_run


def demo(
    out: Out = Path("results/demo"),
    wall_requests: Annotated[int, typer.Option(min=1, help="Requests per client in wall time.")] = 100,
    virtual_requests: Annotated[int, typer.Option(min=1, help="Requests per client in virtual time.")] = 1000,
) -> None:
    """Run the round-trip experiment in wall time, then in virtual time, and write a report."""
    console = Console()
    experiments = []
    for clock, requests in ((ClockName.WALL, wall_requests), (ClockName.VIRTUAL, virtual_requests)):
        experiment = run(plan(clock, MAPPINGS, requests, 0, out, "miniitx-zynq7100"), quiet=False)
        print_tables(console, experiment)
        if experiment["interrupted"]:
            raise typer.Exit(130)
        experiments.append(experiment)
    runs = [load_run(out / clock) for clock in ClockName]
    report = out / "report.html"
    write_report(report, [experiment for experiment, _ in runs], [records for _, records in runs])
    print(f"report: {report}")
    raise typer.Exit(0 if all(map(all_right, experiments)) else 1)
