"""How far to trust the figures: how close they are to the real board, why, and what is not known."""

from __future__ import annotations

from functools import cache
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reconros_zenoh.measure.compare import LOGGED_MODULO_MS, accuracy, accuracy_sentence, grade
from reconros_zenoh.measure.markup import table
from reconros_zenoh.measure.reference.zynq7100 import reference_cells
from reconros_zenoh.measure.statistics import format_error, format_ms, format_share

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from reconros_zenoh.measure.markup import Cell
    from reconros_zenoh.measure.record import Record

_RESAMPLES = 500
_INTERVAL = (2.5, 97.5)
_WIDEST_BAR_EM = 12

_CANNOT_TELL = """\
Nothing about times beyond a second: the paper's clients logged them modulo 1 s, so 1.2 s reads as 0.2 s.
The real means only roughly: a few retransmissions decide them, as their intervals show. Medians and \
quartiles were compared and fitted, means were not. The same holds for the tails, the 99th percentile and \
beyond.
The real intervals are bootstrapped from the stored percentiles (every half percent), because the raw logs \
do not ship with this program. All intervals take the values as independent of each other, which successive \
round trips are not quite, so they are rather too narrow.
The intervals say how exactly one run gives a figure. They do not say how much the real board differs from \
one day to another: its own medians moved by up to 6 %.
Constants of the board profile that are marked assumed were not measured at all; the command reconros \
calibrate says which of the calibrated ones the data do not determine.
"""


class Interval(NamedTuple):
    """A figure of a sample and the 95 % bootstrap interval around it."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """Show it in ms."""
        return f"{format_ms(self.value)} ({format_ms(self.low)} to {format_ms(self.high)})"


class Figures(NamedTuple):
    """What a sample says."""

    median: Interval
    mean: Interval
    p99: Interval


class _Compared(NamedTuple):
    """A cell that the real board has: the error of our median, and the figures of both."""

    mapping: str
    client: str
    error: float
    ours: Figures
    real: Figures


def bootstrap(values: npt.NDArray[np.float64]) -> Figures:
    """Return median, mean and 99th percentile of the values (at least one) with their 95 % intervals.

    The percentile bootstrap: each figure over 500 samples drawn from the values with replacement; the same
    values give the same intervals.
    """
    rng = np.random.default_rng(0)
    figures = np.array(
        [_figures(values[rng.integers(values.size, size=values.size)]) for _ in range(_RESAMPLES)]
    )
    low, high = np.percentile(figures, _INTERVAL, axis=0)
    return Figures(
        *(Interval(*figure) for figure in zip(_figures(values), low.tolist(), high.tolist(), strict=True))
    )


def trust_section(
    experiments: Sequence[Mapping[str, Any]],
    records: Sequence[Mapping[str, Mapping[str, Record]]],
    ablation: Mapping[str, Any] | None,
) -> list[str]:
    """Return the section as pieces of HTML, none if no cell was measured on the real board.

    It is about the run in virtual time if there is one, where the host has no part in the figures. `ablation`
    is as `write_report` takes it.
    """
    pairs = list(zip(experiments, records, strict=True))
    chosen = [pair for pair in pairs if pair[0]["clock"] == "virtual"] or pairs
    if not chosen or not accuracy(chosen[0][0]["mappings"])["cells"]:
        return []
    experiment, its_records = chosen[0]
    compared = _compared(experiment["mappings"], its_records)
    closeness = accuracy_sentence(accuracy(experiment["mappings"])).removeprefix("accuracy: ")
    parts = [
        "<h2>How far to trust this</h2>",
        f"<p>The run in {escape(experiment['clock'])} time: {escape(closeness)}</p>",
        "<h3>Each median beside the real board's</h3>",
        _medians(compared),
        '<p class="small">Times in ms, modulo 1 s, in brackets the 95 % bootstrap interval.</p>',
    ]
    if ablation:
        parts += ["<h3>What each mechanism of the model is worth</h3>", *_ablation(ablation)]
    unknown = "".join(f"<li>{escape(sentence)}</li>" for sentence in _CANNOT_TELL.splitlines())
    parts += [
        "<h3>What the data cannot tell</h3>",
        f"<ul>{unknown}</ul>",
        _tails(compared),
        '<p class="small">Times in ms, modulo 1 s, in brackets the 95 % bootstrap interval.</p>',
    ]
    return parts


def _figures(values: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    median, p99 = np.percentile(values, (50, 99))
    return float(median), float(values.mean()), float(p99)


@cache
def _real_figures(mapping: str, client: str) -> Figures:
    cell = reference_cells()[mapping][client]
    # As many values as were measured, at even steps of the known distribution.
    return bootstrap(np.array([cell.percentile(100 * (i + 0.5) / cell.n) for i in range(cell.n)]))


def _compared(
    mappings: Mapping[str, Mapping[str, Mapping[str, Any]]], records: Mapping[str, Mapping[str, Record]]
) -> list[_Compared]:
    """Return the cells that the real board has, by client."""
    clients = dict.fromkeys(client for row in mappings.values() for client in row)
    return [
        _Compared(
            mapping,
            client,
            row[client]["median_error"],
            bootstrap(records[mapping][client].values_ms % LOGGED_MODULO_MS),
            _real_figures(mapping, client),
        )
        for client in clients
        for mapping, row in mappings.items()
        if client in row and row[client]["median_error"] is not None
    ]


def _medians(compared: Sequence[_Compared]) -> str:
    rows: list[list[Cell]] = [
        [
            cell.client,
            cell.mapping,
            str(cell.ours.median),
            str(cell.real.median),
            (format_error(cell.error), grade(cell.error)),
        ]
        for cell in compared
    ]
    return table(["client", "mapping", "our median", "real median", "error"], rows)


def _tails(compared: Sequence[_Compared]) -> str:
    rows: list[list[Cell]] = [
        [
            cell.client,
            cell.mapping,
            *map(str, (cell.ours.mean, cell.real.mean, cell.ours.p99, cell.real.p99)),
        ]
        for cell in compared
    ]
    return table(["client", "mapping", "our mean", "real mean", "our p99", "real p99"], rows)


def _ablation(ablation: Mapping[str, Any]) -> list[str]:
    variants = ablation["variants"]
    errors = [variant["accuracy"]["mean_absolute_error"] for variant in variants]
    complete, widest = errors[0], max(errors)
    rows = []
    for variant, error in zip(variants, errors, strict=True):
        of = variant["accuracy"]
        worst = of["worst"]
        width_em = _WIDEST_BAR_EM * error / widest if widest else 0
        rows.append(
            f"<tr><td>{escape(variant['off'])}</td>"
            f'<td><span class="bar" style="width:{width_em:.2f}em"></span></td>'
            f'<td class="number">{format_share(error)}</td>'
            f'<td class="number">{format_error(error - complete)}</td>'
            f'<td class="number">{format_share(of["mean_absolute_error_without_hash"])}</td>'
            f'<td class="number">{of["within_10_percent"]} of {of["cells"]}</td>'
            f"<td>{escape(worst['client'])} under {escape(worst['mapping'])} "
            f"({format_error(worst['error'])})</td></tr>"
        )
    head = "".join(
        f'<th class="{column}">{text}</th>'
        for text, column in (
            ("switched off", "text"),
            ("mean absolute error of the medians", "text"),
            ("", "number"),
            ("more than with nothing off", "number"),
            ("without hash", "number"),
            ("within 10 %", "number"),
            ("worst", "text"),
        )
    )
    how = (
        "The same experiment with one mechanism of the board model switched off at a time, in virtual time, "
        f"with {ablation['requests']} requests per client and {len(ablation['seeds'])} seeds together; the "
        "constants were not fitted again. What changes little here may still shape the tails, which the "
        "medians do not see."
    )
    return [
        f"<p>{escape(how)}</p>",
        f'<div class="wide"><table><tr>{head}</tr>' + "\n".join(rows) + "</table></div>",
    ]
