"""`reconros demo`: the main job from beginning to end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.console import interrupted, wide_console
from reconros_zenoh.cli.experiment import MAPPINGS, plan, run, show
from reconros_zenoh.cli.options import ClockName, Out
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.experiments.ablation import ablate, runs_of_ablation
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.roundtrip import all_right
from reconros_zenoh.measure.report import write_report
from reconros_zenoh.measure.run import load_run

_PROFILE = "miniitx-zynq7100"
_ABLATION_REQUESTS = 200


def demo(
    out: Out = Path("results/demo"),
    wall_requests: Annotated[int, typer.Option(min=1, help="Requests per client in wall time.")] = 100,
    virtual_requests: Annotated[int, typer.Option(min=1, help="Requests per client in virtual time.")] = 1000,
) -> None:
    """Run the round-trip experiment in both clocks; write a report.

    First in wall time, then in virtual time. The report also says what each mechanism of the board model is
    worth: runs in virtual time without it. Ctrl-C ends it with a report of what was measured.
    """
    console = wide_console()
    runs = []
    ablation = None
    with until_interrupted():  # a signal between two parts, while what was measured is shown
        for clock, requests in ((ClockName.WALL, wall_requests), (ClockName.VIRTUAL, virtual_requests)):
            planned = plan(clock, MAPPINGS, requests, 0, out, _PROFILE)
            experiment = run(planned, quiet=False)
            show(console, experiment)
            if experiment["mappings"]:
                runs.append(load_run(planned.folder))
            if experiment["interrupted"]:
                break
        else:
            total = runs_of_ablation(planned.mappings)
            with (
                run_bar("what each mechanism is worth", total, quiet=False) as advance,
                until_interrupted(),
            ):
                ablation = ablate(read_profile(_PROFILE), planned.mappings, _ABLATION_REQUESTS, advance)
    if not runs:
        raise interrupted(quiet=False, measured=False)
    experiments, records = zip(*runs, strict=True)
    report = out / "report.html"
    write_report(report, experiments, records, ablation)
    print(f"report: {report}")
    if ablation is None:
        raise interrupted(quiet=False)
    raise typer.Exit(0 if all(map(all_right, experiments)) else 1)
