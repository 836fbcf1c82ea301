"""`reconros experiment design`: the design example, with a shared slot and with two."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.console import PlainConsole, interrupted, new_table, wide_console
from reconros_zenoh.cli.options import AsJson, ClockName, Out, Profile, Seed
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.design_report import FIGURES, format_figure, write_design_report
from reconros_zenoh.measure.findings import host_troubles
from reconros_zenoh.measure.statistics import format_ms

if TYPE_CHECKING:
    from collections.abc import Mapping


def design(
    clock: Annotated[
        ClockName, typer.Option(help="Real time with processes, or virtual time.")
    ] = ClockName.WALL,
    seconds: Annotated[
        float,
        typer.Option(min=1, max=86400, metavar="SECONDS", help="How long the camera runs, per variant."),
    ] = 20.0,
    seed: Seed = 0,
    out: Out = Path("results/design"),
    profile: Profile = "miniitx-zynq7100",
    view: Annotated[
        bool, typer.Option("--view", help="Show the filtered pictures in the browser (wall time).")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Section IV: the design example, with one slot or two.

    /filter and /inv_kinematics share a reconfigurable slot, then have one each. Writes report.html. Exit
    status 0 only if pictures and servo indices came, and all that came were right. Ctrl-C keeps what was
    measured.
    """
    from reconros_zenoh.experiments.design import (
        REPORT,
        VARIANTS,
        DesignPlan,
        Ending,
        all_right,
        finish,
        prepare,
    )
    from reconros_zenoh.experiments.design_pictures import pictures_of
    from reconros_zenoh.experiments.interruption import until_interrupted
    from reconros_zenoh.experiments.provenance import own_folder

    modelled = read_profile(profile).model is not None
    if clock is ClockName.VIRTUAL and not modelled:
        raise UsageError(
            f"profile {profile!r} models nothing, so nothing would take any virtual time. Use --clock wall."
        )
    if clock is ClockName.VIRTUAL and view:
        raise UsageError("--view shows pictures as they come, which needs --clock wall.")
    plan = DesignPlan(clock.value, seconds, seed, profile, out)
    with own_folder(plan.folder):
        prepare(plan)
        endings: dict[str, Ending] = {}
        with (
            run_bar("design example", len(VARIANTS), quiet=as_json) as advance,
            until_interrupted() as interruption,
        ):
            if clock is ClockName.VIRTUAL:
                from reconros_zenoh.experiments.design_virtual import run_design_virtual

                run_design_virtual(plan, endings, advance)
            else:
                from reconros_zenoh.experiments.design_wall import run_design_wall
                from reconros_zenoh.experiments.endpoints import free_port

                port = free_port() if view else None
                if view:
                    PlainConsole(stderr=True).print(f"the pictures are at http://127.0.0.1:{port}/")
                run_design_wall(plan, endings, advance, port)
        experiment = finish(plan, endings, interrupted=interruption.happened)
        variants = experiment["variants"]
        if variants:
            write_design_report(plan.folder / REPORT, experiment, pictures_of(plan, variants))
    if as_json:
        print(json.dumps(experiment))
    elif variants:
        _print_table(wide_console(), variants)
        print(f"report: {plan.folder / REPORT}")
    if interruption.happened:
        raise interrupted(quiet=as_json, measured=bool(variants))
    raise typer.Exit(0 if all_right(experiment) else 1)


def _print_table(console: PlainConsole, variants: Mapping[str, Mapping[str, Any]]) -> None:
    table = new_table(("",), variants)
    for key, text in FIGURES.items():
        table.add_row(text, *(format_figure(key, variant[key]) for variant in variants.values()))
    for chain, text in (("filter_ms", "camera to viewer"), ("control_ms", "command to servo index")):
        for point in ("median", "p95"):
            table.add_row(
                f"{text}, {point}", *(format_ms(variant[chain][point]) for variant in variants.values())
            )
    console.print(table)
    console.print("Times in ms.", style="dim")
    for name, measured in variants.items():
        for trouble in host_troubles(measured["host"]):
            console.print(Text(f"host, {name}: {trouble}", style="yellow"))
