"""`reconros experiment driving`: Section 6 of the gateways paper."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.cli.console import interrupted, new_table, wide_console
from reconros_zenoh.cli.options import AsJson, Out, Profile
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.experiments.provenance import own_folder, write_experiment, writing
from reconros_zenoh.measure.statistics import format_error, format_part

if TYPE_CHECKING:
    from rich.console import Console

    from reconros_zenoh.experiments.driving import Drive

_DRAWING = "driving.png"
_ROWS = {
    "chain_mean_ms": "whole chain",
    "chain_sd_ms": "its standard deviation",
    "paper_mean_ms": "the paper's chain",
    "paper_sd_ms": "the paper's standard deviation",
    "loop_median_ms": "robot's picture to its command",
}


def driving(
    pictures: Annotated[
        int, typer.Option(min=20, help="How many pictures the robot takes, 10 a second.")
    ] = 100,
    profile: Profile = "zcu104",
    out: Out = Path("results/driving"),
    as_json: AsJson = False,
) -> None:
    """Section 6 of the gateways paper: driving along a lane.

    A robot's nodes compensate, blur and plan in slots; ORB key points are found in software. In virtual time,
    with every topic in memory, then with streams between the nodes in hardware, then with a gateway, too.
    Exit status 0 only if every picture had its command and the robot kept its lane and heeded the light.
    """
    from reconros_zenoh.board.profile import read_profile
    from reconros_zenoh.experiments.driving import (
        FILES,
        VARIANTS,
        check_profile,
        run_variant,
        summary,
        troubles,
        write_records,
    )
    from reconros_zenoh.experiments.interruption import until_interrupted

    board = read_profile(profile)
    check_profile(board)
    drives = {}
    with own_folder(out):
        with writing(out):
            parts = (f"{variant}/{file}" for variant in VARIANTS for file in FILES)
            for name in (*parts, "experiment.json", _DRAWING):
                (out / name).unlink(missing_ok=True)
        with (
            run_bar("driving", len(VARIANTS), quiet=as_json) as advance,
            until_interrupted() as interruption,
        ):
            for variant in VARIANTS:
                drives[variant] = run_variant(board, variant, pictures)
                advance()
        experiment = summary(board, pictures, drives, interrupted=interruption.happened)
        write_records(out, drives)
        write_experiment(out, experiment)
        if as_json:
            print(json.dumps(experiment))
        elif drives:
            _print(wide_console(), experiment, troubles(experiment))
            print(f"records and experiment.json are in {out}")
        if drives:
            _draw(out / _DRAWING, experiment, drives)
            if not as_json:
                print(f"drawn to {out / _DRAWING}")
    if interruption.happened:
        raise interrupted(quiet=as_json, measured=bool(drives))
    raise typer.Exit(1 if troubles(experiment) else 0)


def _draw(path: Path, experiment: dict[str, Any], drives: dict[str, Drive]) -> None:
    from reconros_zenoh.applications.driving.kernels import blur, compensate, plan_lane
    from reconros_zenoh.applications.driving.world import Robot, World
    from reconros_zenoh.measure.driving_plots import driving_figure
    from reconros_zenoh.measure.plots import write_figure

    picture = World().picture(Robot.after(1.2), 0, 0)
    *_, last = drives.values()
    figure = driving_figure(
        experiment,
        [(step.seconds, step.speed, step.red) for step in last.steps],
        {
            "the camera's picture": picture[..., ::-1],
            "the lines from above": plan_lane(blur(compensate(picture))),
        },
    )
    write_figure(figure, path)


def _print(console: Console, experiment: dict[str, Any], troubles: list[str]) -> None:
    title = "the chain from Image Compensation to Lane Control: means in ms"
    table = new_table(("",), experiment["variants"], title=title, padding=1)
    variants = experiment["variants"].values()
    for section in next(iter(variants))["sections_ms"]:
        table.add_row(section, *(format_part(variant["sections_ms"][section]) for variant in variants))
    for key, text in _ROWS.items():
        table.add_row(text, *(format_part(variant[key]) for variant in variants))
    console.print(table)
    for anchor in experiment["anchors"]:
        error = format_error(anchor["error"])
        console.print(f"{anchor['name']}: {anchor['ours']:.2f}, paper {anchor['paper']:.2f} ({error})")
    speedup = experiment["speedup_of_all"]
    if speedup["ours"] is not None:
        console.print(
            f"speedup by streams and gateway: {speedup['ours']:.2f}; of an earlier application, with other "
            f"nodes, the paper quotes {speedup['paper_earlier_application']}"
        )
    for trouble in troubles:
        console.print(Text(trouble, style="yellow"))
