"""The report of an experiment: one HTML file that needs nothing else."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from reconros_zenoh.measure.compare import error_note, grade
from reconros_zenoh.measure.findings import findings, host_troubles
from reconros_zenoh.measure.markup import figure, table, write_page
from reconros_zenoh.measure.plots import grid_figure, inline_svg, spans_figure, stage_colours
from reconros_zenoh.measure.reference.zynq7100 import (
    PRINTED_SPEEDUPS_OF_MEANS,
    SWAPPED_COLUMNS,
    reference_cells,
    reference_notes,
)
from reconros_zenoh.measure.statistics import format_error, format_ms, format_part, format_speedup
from reconros_zenoh.measure.trust import trust_section

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from reconros_zenoh.measure.markup import Cell
    from reconros_zenoh.measure.record import Record

_TITLE = "Round-trip times in software and in hardware"

_CLOCKS = {
    "virtual": "Virtual time: the board is simulated event by event; the same seed gives the same figures.",
    "wall": "Wall time: board and clients are processes of their own that talk over a network in real time.",
}


def write_report(
    path: Path,
    experiments: Sequence[Mapping[str, Any]],
    records: Sequence[Mapping[str, Mapping[str, Record]]],
    ablation: Mapping[str, Any] | None = None,
) -> None:
    """Write one self-contained HTML file about the experiments, `records[i]` belonging to `experiments[i]`.

    Experiments and records are as `load_run` returns them, one per clock. `ablation` has `requests`, `seeds`
    and `variants`, a list of `off` and `accuracy` with the complete model first. The file is complete or
    not there: it replaces an older one at the end. Raises UsageError if it cannot be written.
    """
    write_page(path, _TITLE, _parts(experiments, records, ablation))


def _parts(
    experiments: Sequence[Mapping[str, Any]],
    records: Sequence[Mapping[str, Mapping[str, Record]]],
    ablation: Mapping[str, Any] | None,
) -> list[str]:
    parts = [_introduction(experiments), "<h2>In short</h2>"]
    parts += [_summary(experiment) for experiment in experiments]
    for experiment, its_records in zip(experiments, records, strict=True):
        parts += _section(experiment, its_records)
    parts += trust_section(experiments, records, ablation)
    notes = "".join(f"<li>{escape(note)}</li>" for note in reference_notes())
    parts += [f"<h2>The real board's data</h2><ul>{notes}<li>{escape(SWAPPED_COLUMNS)}</li></ul>"]
    parts += ["<h2>How it was made</h2>", *(_origin(experiment) for experiment in experiments)]
    return parts


def _introduction(experiments: Sequence[Mapping[str, Any]]) -> str:
    clients = dict.fromkeys(client for e in experiments for row in e["mappings"].values() for client in row)
    text = (
        f"Client programs ({', '.join(clients)}) send requests to an emulated board that has processor cores "
        "and an FPGA. Each waits for the answer before it sends the next request and notes how long that "
        "took: the round-trip time. A mapping says which of the board's callbacks run in software on the "
        "cores and which in hardware, in the reconfigurable slots of the FPGA. The authors of the ReconROS "
        "executor measured three mappings on a real board, a Zynq Z7100; where one of them was run, their "
        "figures stand beside ours."
    )
    if "hash" in clients:
        text += (
            " The hash client sends nothing: a timer on the board starts its callback every 250 ms, and the "
            "figure is the time between two messages."
        )
    return f"<p>{escape(text)}</p>"


def _summary(experiment: Mapping[str, Any]) -> str:
    items = "".join(
        f'<li class="{"bad" * finding.warning}">'
        f"<b>{escape(finding.subject)}</b>: {escape(finding.sentence)}</li>"
        for finding in findings(experiment)
    )
    return f"<h3>{escape(_name(experiment))}</h3><ul>{items}</ul>"


def _section(experiment: Mapping[str, Any], records: Mapping[str, Mapping[str, Record]]) -> list[str]:
    parts = [f"<h2>{escape(_name(experiment))}</h2>"]
    if not any(records.values()):
        return [*parts, "<p>Nothing was measured.</p>"]
    if clock := _CLOCKS.get(experiment["clock"]):
        parts.append(f"<p>{clock}</p>")
    if experiment.get("interrupted"):
        parts.append('<p class="warning">The run was interrupted: its last mapping ended early.</p>')
    if experiment["clock"] == "wall" and (troubles := host_troubles(experiment["host"])):
        parts.append(
            '<p class="warning"><b>These figures are partly the host\'s.</b> '
            f"{' '.join(troubles)} Trust the virtual clock, or run again on a less busy computer.</p>"
        )
    parts += [
        "<h3>How often each round-trip time occurred</h3>",
        figure(
            inline_svg(grid_figure(records)),
            "Round-trip times per client and mapping",
            "Coloured: this run. Dashed: its mean. Grey: the real board, where it was measured (modulo 1 s). "
            "All panels of a client share one time axis, so mappings can be compared; it is cut where the "
            "tails get thin, and the share outside is written below. After ReconROS Executor, Fig. 6.",
        ),
        "<h3>Medians, and the real board's</h3>",
        _medians(experiment),
        (
            '<p class="small">Times in ms. The error is our median against the real board\'s. '
            f"{error_note(experiment['requests'])}</p>"
        ),
        "<h3>Speedups</h3>",
        _speedups(experiment),
    ]
    spans = _in_order(experiment.get("spans") or {}, _clients(experiment["mappings"]))
    if any(spans.values()):
        parts += [
            "<h3>Where the time goes</h3>",
            figure(
                inline_svg(spans_figure(spans)),
                "Mean time per stage, client and mapping",
                "The mean time of each stage on a message's way, from the request (or hash's timer) to "
                "the answer. The stages are stacked; the number at the end is their sum.",
            ),
            "<details><summary>The same as a table</summary>",
            _stages(spans),
            "</details>",
        ]
    return parts


def _medians(experiment: Mapping[str, Any]) -> str:
    rows: list[list[Cell]] = []
    for mapping, client, cell in _by_client(experiment["mappings"]):
        rows.append(
            [
                client,
                mapping,
                str(cell["n"]),
                (str(cell["lost"]), "bad" if cell["lost"] else ""),
                (str(cell["wrong"]), "bad" if cell["wrong"] else ""),
                *(format_ms(cell[key]) for key in ("median_ms", "reference_median_ms")),
                (format_error(cell["median_error"]), grade(cell["median_error"])),
                *(
                    format_ms(cell[key])
                    for key in ("p5_ms", "p25_ms", "p75_ms", "p95_ms", "p99_ms", "max_ms", "mean_ms")
                ),
            ]
        )
    head = (
        "client, mapping, answers, lost, wrong, median, real board, error, p5, p25, p75, p95, p99, max, mean"
    )
    return table(head.split(", "), rows)


def _speedups(experiment: Mapping[str, Any]) -> str:
    if not experiment["speedup_of_means"]:
        return "<p>all_software was not run, so there is nothing to compare the mappings with.</p>"
    reference = reference_cells()
    rows: list[list[Cell]] = []
    for mapping, client, mean in _by_client(experiment["speedup_of_means"]):
        median = experiment["speedup_of_medians"].get(mapping, {}).get(client)
        software, board = reference["all_software"].get(client), reference.get(mapping, {}).get(client)
        rows.append(
            [
                client,
                mapping,
                format_speedup(median),
                format_speedup(software.median_ms / board.median_ms if software and board else None),
                format_speedup(mean),
                format_speedup(software.mean_ms / board.mean_ms if software and board else None),
                format_speedup(PRINTED_SPEEDUPS_OF_MEANS.get(mapping, {}).get(client)),
            ]
        )
    head = [
        "client",
        "mapping",
        "medians",
        "medians, real board",
        "means",
        "means, real board",
        "means, as printed",
    ]
    return (
        table(head, rows)
        + '<p class="small">all_software over the mapping: above 1 the mapping is faster. The means hang on '
        "few values of the tail; compare the medians. Those of the real board are of times modulo 1 s, ours "
        f"of whole times, which tells for sobel. {escape(SWAPPED_COLUMNS)}</p>"
    )


def _stages(spans: Mapping[str, Mapping[str, Mapping[str, float]]]) -> str:
    cells = _by_client(spans)
    stages = list(stage_colours(stage for _, _, cell in cells for stage in cell))
    rows: list[list[Cell]] = [
        [client, mapping, *(format_part(cell.get(stage)) for stage in stages)]
        for mapping, client, cell in cells
    ]
    return table(["client", "mapping", *stages], rows)


def _origin(experiment: Mapping[str, Any]) -> str:
    shown = {
        key: experiment[key]
        for key in ("command", "profile", "clock", "requests", "seed", "date")
        if key in experiment
    }
    shown |= {f"version of {name}": version for name, version in experiment.get("versions", {}).items()}
    for mapping, callbacks in experiment.get("timing", {}).items():
        shown[f"times of callbacks: {mapping}"] = ", ".join(
            f"{name} in {place} from {time['basis']}"
            for name, places in callbacks.items()
            for place, time in places.items()
        )
    shown |= {f"host: {key}": value for key, value in experiment["host"].items()}
    rows = "".join(
        f"<tr><td>{escape(key)}</td><td>{escape(str(value))}</td></tr>" for key, value in shown.items()
    )
    return f'<h3>{escape(_name(experiment))}</h3><div class="wide"><table>{rows}</table></div>'


def _name(experiment: Mapping[str, Any]) -> str:
    return f"{experiment['experiment']}, {experiment['clock']} clock"


def _by_client(cells: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, Any]]:
    """Return the cells as (mapping, client, cell), with a client's mappings beside each other."""
    return [
        (mapping, client, row[client])
        for client in _clients(cells)
        for mapping, row in cells.items()
        if client in row
    ]


def _clients(cells: Mapping[str, Mapping[str, Any]]) -> Iterable[str]:
    return dict.fromkeys(client for row in cells.values() for client in row)


def _in_order(cells: Mapping[str, Mapping[str, Any]], clients: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return the cells with these clients first: a board tells them in the order of their first answers."""
    return {
        mapping: {client: row[client] for client in dict.fromkeys([*clients, *row]) if client in row}
        for mapping, row in cells.items()
    }
