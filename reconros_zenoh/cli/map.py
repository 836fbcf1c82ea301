"""`reconros map`: the communication mapping of a project, of a graph file, or of what runs."""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer
from rich.text import Text

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.console import new_table, wide_console
from reconros_zenoh.cli.options import ENDPOINT, AsJson, Domain, MappingName, Router
from reconros_zenoh.cli.printable import printable
from reconros_zenoh.errors import UsageError
from reconros_zenoh.mapping.communication import Crossings, map_topics
from reconros_zenoh.mapping.graph_file import read_graph_file
from reconros_zenoh.mapping.predict import Predictions
from reconros_zenoh.mapping.summary import summarise
from reconros_zenoh.measure.statistics import format_share

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rich.console import Console

    from reconros_zenoh.mapping.communication import TopicMapping
    from reconros_zenoh.mapping.graph import ComputationGraph, Edge
    from reconros_zenoh.project.loader import ProjectFiles
    from reconros_zenoh.project.mapping_file import ProjectMapping


class _MappedProject(NamedTuple):
    """A project, and which of its callbacks runs where."""

    files: ProjectFiles
    mapping: ProjectMapping


def map_communication(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="PROJECT|GRAPH.yaml",
            help="Folder of a ReconROS project, or a graph file.",
            show_default=False,
        ),
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Read the ROS graph of what runs instead.")] = False,
    hardware: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NODE", help="With --live: a node in hardware; may be repeated.", show_default=False
        ),
    ] = None,
    mapping: MappingName = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="PROFILE", help="Decide by the transfer times of this board.", show_default=False
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the mapped graph: .svg, .png or .dot.", show_default=False),
    ] = None,
    apply: Annotated[
        bool, typer.Option("--apply", help="Write HMTs and gateways into the project's build.cfg.")
    ] = False,
    router: Router = ENDPOINT,
    domain: Domain = 0,
    as_json: AsJson = False,
) -> None:
    """Map topics to software, hardware, or both with a gateway.

    The three cases of Mapping and Optimizing, Section 5, and the edges over the boundary before and after.
    """
    if hardware and not live:
        raise UsageError("--hardware names nodes of --live; projects and graph files say it themselves.")
    if live:
        graph, project = _read_live(router, domain, hardware or [], source), None
    else:
        graph, project = _read(source, mapping, with_sizes=model is not None)
    if project is None and (mapping is not None or apply):
        raise UsageError(f"{'--apply' if apply else '--mapping'} needs the folder of a project.")
    rule = map_topics(graph)
    by_rule = {name: decision.mapping for name, decision in rule.items()}
    predictions = Predictions.of(graph, read_profile(model), rule) if model else None
    mappings = predictions.mappings if predictions else by_rule
    result = summarise(graph, rule, predictions)
    if plot:
        from reconros_zenoh.mapping.drawing import write_drawing  # loads networkx

        write_drawing(plot, graph, mappings)
    if project is not None:
        _add_project(result, project, mappings, apply=apply)
    if as_json:
        print(json.dumps(result))
        return
    for warning in result["warnings"]:
        print(printable(f"warning: {warning}"), file=sys.stderr)
    _print(wide_console(), result, Crossings.of(graph, by_rule))
    if plot:
        print(f"drawn to {plot}")
    if apply:
        print("\n".join(result["applied"]) or "nothing to add to build.cfg")


def _read(
    source: Path | None, mapping: str | None, *, with_sizes: bool
) -> tuple[ComputationGraph, _MappedProject | None]:
    if source is None:
        raise UsageError("nothing to map. Give the folder of a project, a graph file (*.yaml), or --live.")
    if source.suffix in {".yaml", ".yml"}:
        return read_graph_file(source), None
    if not source.is_dir():
        raise UsageError(f"{source} is no folder. Give that of a ReconROS project, or a graph file (*.yaml).")
    from reconros_zenoh.mapping.project_graph import read_project_graph
    from reconros_zenoh.project.loader import read_project

    files = read_project(source)
    with files.with_its_causes():
        project = _MappedProject(files, files.mapping(mapping))
    types = files.types() if with_sizes else None  # to load them takes as long as all the rest
    return read_project_graph(files.configuration, project.mapping, types), project


def _add_project(
    result: dict[str, Any], project: _MappedProject, mappings: Mapping[str, TopicMapping], *, apply: bool
) -> None:
    """Add what is to be said of the project; with `apply` write the mapping, and add what that changes."""
    from reconros_zenoh.mapping.apply import apply_mapping, kept_streams
    from reconros_zenoh.mapping.project_graph import shared_slots
    from reconros_zenoh.project.loader import read_project

    files = project.files
    result["notes"] += shared_slots(files.configuration, project.mapping, mappings)
    result["warnings"] += files.configuration.warnings
    if apply:
        before = files.unusable_mappings()
        result["warnings"] += kept_streams(files.configuration, project.mapping, mappings)
        result["applied"] = apply_mapping(files.configuration, project.mapping, mappings)
        after = read_project(files.folder).unusable_mappings()
        result["warnings"] += [
            f"{path} cannot be used any more: {error}" for path, error in after.items() if path not in before
        ]


def _read_live(router: str, domain: int, hardware: list[str], source: Path | None) -> ComputationGraph:
    if source is not None:
        raise UsageError(f"--live reads what runs, and nothing from {source}. Give one of the two.")
    from reconros_zenoh.mapping.live_graph import read_live_graph
    from reconros_zenoh.transport.zenoh import ZenohTransport

    with ZenohTransport.open(router, as_client=True) as transport:
        return read_live_graph(transport, domain, hardware)


def _print(console: Console, result: Mapping[str, Any], crossings: Crossings) -> None:
    table = new_table(("topic", "mapping", "publishers", "subscribers", "reason"), padding=1)
    for topic in result["topics"]:
        table.add_row(
            Text(topic["name"]),
            topic["mapping"],
            *(Text(", ".join(topic[key]) or "-") for key in ("publishers", "subscribers")),
            topic["reason"],
        )
    console.print(table)
    _print_sets(console, result)
    console.print(
        f"Edges over the boundary: {_count(crossings.all_software)} with every topic in software, "
        f"{_count(crossings.hardware_topics)} with T_HW in hardware, "
        f"{_count(crossings.gateways)} with gateways.",
        highlight=False,
    )
    if "predicted" in result:
        _print_predictions(console, result)
    for note in result["notes"]:
        console.print(Text(note, style="dim"))


def _print_predictions(console: Console, result: Mapping[str, Any]) -> None:
    predicted = result["predicted"]
    console.print(f"\nBy the transfer times of {predicted['model']}:", style="bold", highlight=False)
    columns = ("topic", "rule", "predicted", "SMT HW/SW", "gateway HW/SW", "changeover", "reason")
    table = new_table(columns, padding=1)
    for topic in result["topics"]:
        prediction = topic["predicted"]
        other = prediction["mapping"] != topic["mapping"]
        table.add_row(
            Text(topic["name"]),
            topic["mapping"],
            Text(prediction["mapping"], style="bold yellow" if other else ""),
            _times(prediction["smt"]),
            _times(prediction["gateway"]),
            _changeover(prediction["changeover"]),
            prediction["reason"],
        )
    console.print(table)
    _print_sets(console, predicted)
    print_line = partial(console.print, highlight=False)
    print_line(f"Edges over the boundary: {predicted['crossings']}.")
    loads = predicted["memif_load"]
    if None in loads.values():
        print_line("The MEMIF load needs size and rate of every topic with an end in hardware.", style="dim")
    else:
        print_line(
            f"MEMIF load: {format_share(loads['all_software'])} with every topic in software, "
            f"{format_share(loads['rule'])} by the rule, {format_share(loads['predicted'])} as predicted."
        )
    print_line(
        "Times in ms, to the slowest subscriber in hardware / in software. The mean over all pairs of "
        "publisher and subscriber decides; each subscriber in hardware counts as the slowest.",
        style="dim",
    )


def _print_sets(console: Console, sets: Mapping[str, Any]) -> None:
    text = "   ".join(
        f"{name} = {{{', '.join(sets[key])}}}"
        for name, key in (("T_SW", "t_sw"), ("T_HW", "t_hw"), ("T_GW", "t_gw"))
    )
    console.print(Text(text))


def _count(edges: Iterable[Edge]) -> str:
    published = [edge.publishes for edge in edges]
    return f"{len(published)} ({published.count(True)} pub, {published.count(False)} sub)"


def _changeover(changeover: Mapping[str, Any] | None) -> str:
    return "-" if changeover is None else f"{changeover['mapping']} from {changeover['bytes']} B"


def _times(forecast: Mapping[str, float | None] | None) -> str:
    if forecast is None:
        return "-"
    return " / ".join(
        "-" if forecast[key] is None else f"{forecast[key]:.3f}" for key in ("hw_max_ms", "sw_ms")
    )
