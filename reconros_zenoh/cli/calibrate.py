"""`reconros calibrate`: a board profile from measurements of that board."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.board.profile import profile_path, read_profile
from reconros_zenoh.cli.console import interrupted, new_table, wide_console
from reconros_zenoh.cli.options import AsJson, Seed
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.calibration import (
    Calibration,
    calibrated_constants,
    planned_evaluations,
)
from reconros_zenoh.experiments.calibration import calibrate as fit
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.measured import read_measurements
from reconros_zenoh.experiments.profile_file import new_profile, with_values
from reconros_zenoh.experiments.roundtrip import application
from reconros_zenoh.measure.compare import error_text
from reconros_zenoh.measure.statistics import format_ms
from reconros_zenoh.toml_file import TomlFile

if TYPE_CHECKING:
    from rich.console import Console


def calibrate(
    profile: Annotated[str, typer.Option(metavar="NAME|FILE", help="The profile to start from.")],
    data: Annotated[
        list[Path],
        typer.Option(
            metavar="DIR...",
            help="Measured round trips: DIR/<mapping>/<client>.csv, times in ms. May be repeated.",
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The profile to write.")],
    more_data: Annotated[
        list[Path] | None, typer.Argument(metavar="[DIR...]", help="More of --data.", show_default=False)
    ] = None,
    mapping: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=NAME|FILE",
            help="The mapping of the folder NAME, if that is no mapping's name and has no NAME.toml beside "
            "it. May be repeated.",
            show_default=False,
        ),
    ] = None,
    trim: Annotated[
        bool,
        typer.Option(
            "--trim",
            help="Leave out each file's first and last value: warm-up and total in the paper's logs.",
        ),
    ] = False,
    rounds: Annotated[
        int, typer.Option(min=1, help="Rounds of the search; each tries all constants up and down.")
    ] = 5,
    requests: Annotated[
        int, typer.Option(min=20, help="Requests per client and run; more lower the noise.")
    ] = 300,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Fit a profile's calibrated constants to measured round trips.

    All other constants are held. Ctrl-C ends the search and keeps the best that it has found.
    """
    start = read_profile(profile)
    source = TomlFile.read(profile_path(profile))
    constants = calibrated_constants(start)
    project = application()
    measured = read_measurements([*data, *(more_data or [])], project, _assignments(mapping or []), trim=trim)
    with new_profile(out) as file:
        total = planned_evaluations(constants, rounds)
        with (
            run_bar(f"fitting {len(constants)} constants", total, quiet=as_json) as advance,
            until_interrupted() as interruption,
        ):
            found = fit(start, measured, rounds, requests, seed, advance)
        if interruption.happened:
            raise interrupted(quiet=as_json, measured=False)
        values = {
            each.constant.place: each.value for each in found.constants if each.value != each.constant.value
        }
        file.write_text(with_values(source, values, found.profile), encoding="utf-8")
    if as_json:
        print(json.dumps(_object(found, out, requests, seed)))
    else:
        _print(wide_console(), found)
        print(f"the fitted profile is {out}")
    if found.interrupted:
        raise interrupted(quiet=as_json)


def _assignments(given: list[str]) -> dict[str, str]:
    assigned: dict[str, str] = {}
    for text in given:
        name, equals, mapping = text.partition("=")
        if not (name and equals and mapping):
            raise UsageError(f"--mapping {text}: write NAME=MAPPING, the folder's name and its mapping.")
        assigned[name] = mapping
    return assigned


def _object(found: Calibration, out: Path, requests: int, seed: int) -> dict[str, Any]:
    return {
        "profile": str(out),
        "requests": requests,
        "seed": seed,
        "evaluations": found.evaluations,
        "interrupted": found.interrupted,
        "objective": {"before": found.before, "after": found.after, "noise": found.noise},
        "cells": [
            {
                "mapping": cell.mapping,
                "client": cell.client,
                **{
                    side: dict(zip(("p25_ms", "median_ms", "p75_ms"), quartiles, strict=True))
                    for side, quartiles in (
                        ("measured", cell.measured_ms),
                        ("before", cell.before_ms),
                        ("after", cell.after_ms),
                    )
                },
            }
            for cell in found.cells
        ],
        "constants": [
            {
                "name": each.constant.name,
                "unit": each.constant.unit,
                "old": each.constant.value,
                "new": each.value,
                "sensitivity": each.sensitivity,
                "determined": each.determined,
            }
            for each in found.constants
        ],
    }


def _print(console: Console, found: Calibration) -> None:
    cells = new_table(
        ("mapping", "client"),
        ("measured", "before", "after", "p25", "median", "p75"),
        title="Medians in ms, and the errors of p25, median and p75 after the fit",
        padding=1,
    )
    for cell in found.cells:
        cells.add_row(
            Text(cell.mapping),
            cell.client,
            *(format_ms(side[1]) for side in (cell.measured_ms, cell.before_ms, cell.after_ms)),
            *(
                error_text(ours / real - 1)
                for ours, real in zip(cell.after_ms, cell.measured_ms, strict=True)
            ),
        )
    console.print(cells)
    title = (
        "Constants. Sensitivity: how much quartiles change between 20 % more and 20 % less, as a multiple "
        "of their change from seed to seed"
    )
    constants = new_table(("constant", "unit"), ("old", "new", "sensitivity"), title=title)
    constants.add_column("")
    for each in found.constants:
        constants.add_row(
            each.constant.name,
            each.constant.unit,
            f"{each.constant.value:.4g}",
            f"{each.value:.4g}",
            "-" if each.sensitivity is None else f"{each.sensitivity:.2g}",
            Text("not determined", style="yellow") if each.determined is False else "",
        )
    console.print(constants)
    console.print(
        f"objective {found.before:.3f} before, {found.after:.3f} after; between other seeds it differs by "
        f"{found.noise:.3f} (standard deviation). {found.evaluations} evaluations.",
        highlight=False,
    )
    if all(each.value == each.constant.value for each in found.constants):
        told = "nothing better was found: the constants are as they were. More --requests lower the noise."
        console.print(Text(told, style="yellow"))
    if vague := [each.constant.name for each in found.constants if each.determined is False]:
        console.print(
            Text(
                f"warning: the data do not determine {', '.join(vague)}: 20 % more or less changes the "
                "quartiles hardly more than the seed does. More --requests or other mappings may tell; "
                "otherwise mark them assumed.",
                style="yellow",
            )
        )
