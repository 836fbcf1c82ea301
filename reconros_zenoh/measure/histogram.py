"""Histograms of round-trip times: the bins, their figures, and how they look in a terminal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
from rich.table import Table
from rich.text import Text

from reconros_zenoh.measure.record import short_names
from reconros_zenoh.measure.statistics import format_ms, summarise

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.console import Console

    from reconros_zenoh.measure.record import Record

PERCENTILES = {"p50_ms": 50.0, "p90_ms": 90.0, "p99_ms": 99.0, "p999_ms": 99.9, "max_ms": 100.0}

_ROBUST_PERCENTILES = (0.5, 97.5)  # round-trip times have their long tail upwards
_FEW = 40  # of fewer values 2.5 % are less than one: nothing to leave out
_FROM = "from ms"
_SHARE_WIDTH = 8  # " 100.0 %"
_WIDEST_BAR = 60


class NamedRecord(NamedTuple):
    """A record with the name to show, `mapping/client`, and the file it came from."""

    name: str
    path: Path
    record: Record


@dataclass(frozen=True, eq=False)
class Histogram:
    """How many of a record's answers lie in each bin, and how many outside of all bins."""

    counts: npt.NDArray[np.int64]
    below: int
    above: int


def bin_edges(samples: Sequence[npt.NDArray[np.float64]], bins: int) -> npt.NDArray[np.float64]:
    """Return the edges of `bins` equal bins from the least 0.5th to the greatest 97.5th percentile.

    A sample of fewer than 40 values is within them as a whole.
    Float64 of shape `(bins + 1,)` in the unit of the samples, empty if all samples are.
    """
    ranges = [
        np.percentile(values, _ROBUST_PERCENTILES if values.size >= _FEW else (0, 100))
        for values in samples
        if values.size
    ]
    if not ranges:
        return np.array([], dtype=np.float64)
    low, high = float(min(r[0] for r in ranges)), float(max(r[1] for r in ranges))
    if high - low <= max(1e-6, high * 1e-9):
        # All values alike to a nanosecond: a range around them, wide enough for the edges to differ.
        margin = max(0.5, high * 1e-6)
        low, high = max(0.0, low - margin), high + margin
    return np.linspace(low, high, bins + 1)


def count(values_ms: npt.NDArray[np.float64], edges_ms: npt.NDArray[np.float64]) -> Histogram:
    """Return the histogram of the values over bins with these edges (as from `bin_edges`)."""
    if not edges_ms.size:
        return Histogram(np.array([], dtype=np.int64), 0, 0)
    counts, _ = np.histogram(values_ms, edges_ms)
    below, above = int(np.sum(values_ms < edges_ms[0])), int(np.sum(values_ms > edges_ms[-1]))
    return Histogram(counts.astype(np.int64), below, above)


def describe(entry: NamedRecord, other: NamedRecord | None, bins: int) -> dict[str, Any]:
    """Return the record's figures and bins as JSON-ready values, `compare` with those of the other or None.

    Both share the bins. `median_ratio` is the record's median over the other's, None if either is missing.
    """
    edges_ms = _common_edges(entry, other, bins)
    compare = None
    if other:
        compare = _describe_one(other, edges_ms) | {"median_ratio": _median_ratio(entry, other)}
    return _describe_one(entry, edges_ms) | {"compare": compare}


def print_histogram(console: Console, entry: NamedRecord, other: NamedRecord | None, bins: int) -> None:
    """Print the record's histogram, the other's beside it in the same bins, and the figures of both.

    The bins cover the robust range; how many values lie outside is said below. A dashed line marks the mean.
    """
    shown = [entry] if other is None else [entry, other]
    edges_ms = _common_edges(entry, other, bins)
    console.print(Text(" | ".join(_labels(shown)), style="bold"))
    if edges_ms.size:
        for line in _bars(console, shown, edges_ms):
            console.print(line, no_wrap=True, overflow="crop")
    for label, (_, _, record) in zip(_labels(shown), shown, strict=True):
        for remark in _remarks(record, edges_ms):
            console.print(Text(f"{label}: {remark}", style="dim"))
    console.print(_figures_table(shown))
    if other:
        ratio = _median_ratio(entry, other)
        console.print(f"median ratio {'-' if ratio is None else f'{ratio:.3f}'}", highlight=False)
    console.print()


def _common_edges(entry: NamedRecord, other: NamedRecord | None, bins: int) -> npt.NDArray[np.float64]:
    return bin_edges([e.record.values_ms for e in (entry, other) if e], bins)


def _describe_one(entry: NamedRecord, edges_ms: npt.NDArray[np.float64]) -> dict[str, Any]:
    name, path, record = entry
    histogram = count(record.values_ms, edges_ms)
    return {
        "name": name,
        "path": str(path),
        **summarise(record.values_ms, record.lost, record.wrong, PERCENTILES),
        "bins_ms": edges_ms.tolist(),
        "counts": histogram.counts.tolist(),
        "below": histogram.below,
        "above": histogram.above,
    }


def _median_ratio(entry: NamedRecord, other: NamedRecord) -> float | None:
    ours, theirs = entry.record.values_ms, other.record.values_ms
    if not ours.size or not theirs.size or not np.median(theirs):
        return None
    return float(np.median(ours) / np.median(theirs))


def _labels(shown: list[NamedRecord]) -> list[str]:
    return [shown[0].name] if len(shown) == 1 else short_names([entry.path for entry in shown])


def _bars(console: Console, shown: list[NamedRecord], edges_ms: npt.NDArray[np.float64]) -> list[Text]:
    glyphs = _Glyphs.for_encoding(console.encoding)
    decimals = max(0, 1 - math.floor(math.log10(edges_ms[1] - edges_ms[0])))
    labels = [f"{edge:.{decimals}f}" for edge in edges_ms[:-1]]
    label_width = max(len(_FROM), *map(len, labels))
    room = (console.width - label_width) // len(shown) - _SHARE_WIDTH - 2
    width = max(4, min(_WIDEST_BAR, room))

    samples = [entry.record.values_ms for entry in shown]
    shares = [count(values, edges_ms).counts / max(1, values.size) for values in samples]
    scale = max(float(share.max()) for share in shares)
    mean_bins = [
        int(np.searchsorted(edges_ms, v.mean(), side="right")) - 1 if v.size else -1 for v in samples
    ]

    lines = [
        Text(_FROM.rjust(label_width) + "share".rjust(2 + width + _SHARE_WIDTH) * len(shown), style="dim")
    ]
    for index, label in enumerate(labels):
        line = Text(label.rjust(label_width))
        for share in shares:
            bar = glyphs.bar(share[index] / scale * width if scale else 0.0)
            line.append("  ").append(bar.ljust(width), style="cyan").append(
                f"{share[index]:>7.1%}".replace("%", " %")
            )
        lines.append(line)
        if index in mean_bins:
            line = Text("mean".rjust(label_width), style="yellow")
            for mean_bin, values in zip(mean_bins, samples, strict=True):
                mark = f"{glyphs.dash * width}{format_ms(values.mean()):>7} " if mean_bin == index else ""
                line.append("  ").append(mark.ljust(width + _SHARE_WIDTH))
            lines.append(line)
    for line in lines:
        line.rstrip()
    return lines


class _Glyphs(NamedTuple):
    """The characters of a bar: a full cell, its parts in rising order, and the dash of the mean."""

    full: str
    parts: str
    dash: str

    @classmethod
    def for_encoding(cls, encoding: str) -> _Glyphs:
        glyphs = cls(full="█", parts="▏▎▍▌▋▊▉", dash="╌")
        try:
            "".join(glyphs).encode(encoding)
        except UnicodeEncodeError:
            return cls(full="#", parts="", dash="-")
        return glyphs

    def bar(self, cells: float) -> str:
        """Return a bar of that many cells; whatever is above zero is seen."""
        steps = len(self.parts) + 1
        full, part = divmod(math.ceil(cells * steps) if cells < 1 else round(cells * steps), steps)
        return self.full * full + (self.parts[part - 1] if part else "")


def _remarks(record: Record, edges_ms: npt.NDArray[np.float64]) -> list[str]:
    if not record.values_ms.size:
        return ["no answer"]
    histogram = count(record.values_ms, edges_ms)
    low, high = format_ms(edges_ms[0]), format_ms(edges_ms[-1])
    remarks = []
    if histogram.below or histogram.above:
        remarks.append(
            f"outside the bins {histogram.below} below {low} ms and {histogram.above} above {high} ms"
        )
    mean = float(record.values_ms.mean())
    if not edges_ms[0] <= mean < edges_ms[-1]:
        remarks.append(f"the mean, {format_ms(mean)} ms, lies outside the bins")
    return remarks


def _figures_table(shown: list[NamedRecord]) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
    if len(shown) > 1:
        table.add_column("times in ms", overflow="fold")
    for heading in ("n", "lost", "wrong", "mean", "p50", "p90", "p99", "p99.9", "max"):
        table.add_column(heading, justify="right", overflow="fold")
    for label, (_, _, record) in zip(_labels(shown), shown, strict=True):
        counts = [str(record.values_ms.size), str(record.lost), str(record.wrong)]
        figures = summarise(record.values_ms, record.lost, record.wrong, PERCENTILES)
        times = [format_ms(figures[key]) for key in ("mean_ms", *PERCENTILES)]
        table.add_row(*([Text(label)] if len(shown) > 1 else []), *counts, *times)
    return table
