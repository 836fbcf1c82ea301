"""`reconros compare`: a project under several mappings, with the same to do."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.cli.console import interrupted, new_table, wide_console
from reconros_zenoh.cli.options import AsJson, ModelSeed, ProjectProfile, project_prints
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.cli.status_screen import SHARED_PARTS
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.comparison import MappingRun, outside_topics, run_mapping
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.provenance import own_folder, provenance, write_experiment
from reconros_zenoh.experiments.stimulus import Stimulus, bag_topics, read_inputs
from reconros_zenoh.measure.mapping_plots import ages_figure
from reconros_zenoh.measure.plots import write_figure
from reconros_zenoh.measure.statistics import format_ms, format_share
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.main_file import load_main

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Console

_DRAWING = "compare.png"
_TRACE = "trace.png"
_SECONDS = 10.0
_SHORTEST_S = 0.001


def compare(
    project: Annotated[Path, typer.Argument(help="Folder of a ReconROS project.")],
    mapping: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME|FILE", help="May be given often.", show_default="all of PROJECT/mappings"),
    ] = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="TOPIC[=FIELDS]",
            help="Publish on this topic: zeros, or FIELDS as for `ros2 topic pub`. May be given often.",
            show_default=False,
        ),
    ] = None,
    rate: Annotated[
        float, typer.Option(min=0.001, max=1e6, metavar="HZ", help="The rate of each input.")
    ] = 10.0,
    bag: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Play a rosbag2 recording at its own times.", show_default=False),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            min=_SHORTEST_S,
            max=1e6,
            help="How long, in virtual time.",
            show_default=f"{_SECONDS:g}; with a bag, its length",
        ),
    ] = None,
    profile: ProjectProfile = None,
    seed: ModelSeed = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for records and drawing.")] = Path(
        "results/compare"
    ),
    as_json: AsJson = False,
) -> None:
    """Compare the mappings of a project in virtual time.

    Shows how many messages left the board on each topic, how old they were, what was lost and what limits.
    """
    with project_prints(as_json=as_json), own_folder(out):
        loaded = load_project(project)
        model = loaded.profile(profile)
        if model.model is None:
            raise UsageError(
                f"profile {model.name!r} models nothing, so nothing would take any time. Choose a board that "
                "does with --profile."
            )
        mappings = loaded.mappings(mapping or [*loaded.mapping_files()] or [None])
        first, *_ = mappings.values()
        known, outputs = (outside_topics(loaded.configuration, first, kind) for kind in ("rossub", "rospub"))
        messages = read_inputs(inputs or [], known, loaded.types())
        recorded, length_s = bag_topics(bag, known, loaded.types()) if bag else ({}, _SECONDS)
        heard = {topic: name for topic, name in known.items() if topic in messages or topic in recorded}
        stimulus = Stimulus(heard, messages, round(1e9 / rate), bag)
        if seconds is None and length_s < _SHORTEST_S:
            raise UsageError(f"{bag} is over at once. Say with --seconds how long to go on after its start.")
        seconds = seconds or length_s
        runs: dict[str, MappingRun] = {}
        with (
            run_bar("compare", len(mappings), quiet=as_json, each="mapping") as advance,
            until_interrupted() as interruption,
        ):
            for name, mapped in mappings.items():
                # Anew: what main.py and its modules remember belongs to one run.
                again = replace(loaded, main=load_main(project, loaded.configuration.name))
                options = BoardOptions(seed=seed, trace=out / name / _TRACE)
                runs[name] = run_mapping(model, again, mapped, stimulus, outputs, seconds, options)
                advance()
        experiment = {
            "experiment": "compare",
            "project": loaded.configuration.name,
            "profile": model.name,
            "seconds": seconds,
            "seed": seed,
            "inputs": heard,
            "rate_hz": rate if messages else None,
            "bag": str(bag) if bag else None,
            "silent": [topic for topic in known if topic not in heard],
            "mappings": {name: run.as_json() for name, run in runs.items()},
            "interrupted": interruption.happened,
            **provenance(),
        }
        for name, run in runs.items():
            run.write_records(out / name)
        write_experiment(out, experiment)
        drawn = _draw(out / _DRAWING, runs)
    if as_json:
        print(json.dumps(experiment))
    elif runs:
        _print(wide_console(), experiment)
        print(f"records and experiment.json are in {out}" + (f"; drawn to {out / _DRAWING}" if drawn else ""))
        print(f"what each board did when in its last second: {out}/<mapping>/{_TRACE}")
    if interruption.happened:
        raise interrupted(quiet=as_json, measured=bool(runs))


def _draw(path: Path, runs: Mapping[str, MappingRun]) -> bool:
    """Draw what there is; return whether there was anything."""
    ages_ms = {
        name: {topic: [age / 1e6 for age in ages] for topic, ages in run.ages_ns.items()}
        for name, run in runs.items()
    }
    if not any(ages for of in ages_ms.values() for ages in of.values()):
        path.unlink(missing_ok=True)
        return False
    write_figure(ages_figure(ages_ms), path)
    return True


def _print(console: Console, experiment: Mapping[str, Any]) -> None:
    mappings = experiment["mappings"]
    title = f"{experiment['project']} on {experiment['profile']}, {experiment['seconds']:g} s: ages in ms"
    figures = ("per s", "median", "p95", "p99", "max")
    ages = new_table(("publishes", "mapping"), figures, title=title, padding=1)
    for topic in next(iter(mappings.values()))["outputs"]:
        outputs = {name: measured["outputs"][topic] for name, measured in mappings.items()}
        if any(output["sent"] for output in outputs.values()):
            for name, output in outputs.items():
                times = (format_ms(output[f"{figure}_ms"]) for figure in figures[1:])
                ages.add_row(Text(topic), Text(name), f"{output['rate_hz']:.4g}", *times)
            ages.add_section()
    if ages.row_count:
        console.print(ages)
        told = "age: since the message or timer that it follows from, until it is over the link"
        console.print(told, style="dim")
        console.print()
    title = "what became of the messages, and of the slots"
    boards = new_table(("mapping",), ("lost", "refused", "failed", "swaps"), title=title, padding=1)
    boards.add_column("busiest")
    for name, measured in mappings.items():
        counts = (str(measured[key]) for key in ("dropped", "refused", "failed", "reconfigurations"))
        what, share = measured["busiest"]["what"], measured["busiest"]["share"]
        boards.add_row(Text(name), *counts, f"{SHARED_PARTS.get(what, what)}: {format_share(share)}")
    console.print(boards)
    if experiment["silent"]:
        silent = ", ".join(experiment["silent"])
        console.print(f"nobody published on {silent}: --input TOPIC, or --bag DIR", style="yellow")
