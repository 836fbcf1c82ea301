"""Drawings of round-trip times: the grid of Fig. 6, single histograms, and where the time goes.

matplotlib is imported by the functions that draw, because it takes a second and most commands never draw.
"""

from __future__ import annotations

import io
import re
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.histogram import bin_edges, count
from reconros_zenoh.measure.reference.zynq7100 import reference_cells
from reconros_zenoh.measure.statistics import format_ms

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from contextlib import AbstractContextManager
    from pathlib import Path

    import numpy.typing as npt
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from reconros_zenoh.measure.histogram import NamedRecord
    from reconros_zenoh.measure.record import Record

INK = "#24292f"
GREY = "#8b949e"
_MAPPING_COLOURS = ("#d2691e", "#2f7ec4", "#2a9267", "#9463c0", "#c2485a", "#8a7a1f")
STAGE_COLOURS = {
    "transport": "#73757f",
    "dds": "#335ba3",
    "retransmission": "#ecc8da",
    "queue": "#eba51b",
    "dispatch": "#987810",
    "reconfiguration": "#a5453b",
    "execution": "#7baf8a",
    "memif": "#802cd9",
    "osif": "#2fbfee",
    "blocked": "#158dd5",
    "hmt": "#a9d469",
    "gateway": "#df7b5f",
    "overrun": "#24292f",
}
_GRID_BINS = 60
_GRID_PERCENTILES = (1.0, 50.0, 95.0)
FAR_APART = 5.0
"""Times of which one is more than so many times the other need a logarithmic axis."""
_LEGEND_COLUMNS = 7


def grid_figure(records: Mapping[str, Mapping[str, Record]]) -> Figure:
    """Return a panel per mapping (rows) and client (columns), with the real board behind where it is known.

    Relative frequencies of `records[mapping][client]` as filled steps, the mean as a dashed line. The time
    axis is common to a client, so the mappings can be compared (after ReconROS Executor, Fig. 6).
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  see the module docstring

    clients = list(dict.fromkeys(client for row in records.values() for client in row))
    colours = [mapping_colour(row) for row in range(len(records))]
    with drawing_style():
        figure = Figure(figsize=(1.85 * len(clients) + 0.75, 1.7 * len(records) + 0.7), layout="constrained")
        grid = figure.subplots(len(records), len(clients), squeeze=False)
        for column, client in enumerate(clients):
            edges_ms = _grid_edges(records, client)
            for row, (mapping, of_mapping) in enumerate(records.items()):
                axes = grid[row][column]
                reference = reference_cells().get(mapping, {}).get(client)
                record = of_mapping.get(client)
                behind = reference.density(edges_ms) if reference else None
                _panel(axes, edges_ms, record, behind, colours[row])
                # The empty line makes room for the medians.
                axes.set_title(f"{client}\n", loc="left", fontweight="bold")
                board_ms = reference.median_ms if reference else None
                axes.set_title(_medians(record, "board", board_ms), loc="right", fontsize=8)
        for row, mapping in enumerate(records):
            grid[row][0].set_ylabel(
                wrapped(mapping, 18), fontsize=12, fontweight="bold", color=colours[row], labelpad=10
            )
        figure.supxlabel("round-trip time [ms]; above each panel its median")
        figure.supylabel("relative frequency")
        known = any(client in reference_cells().get(mapping, {}) for mapping in records for client in clients)
        _legend(figure, "this run", "real board" if known else None, colours)
    return figure


def mapping_colour(number: int) -> str:
    """Return the colour of a mapping by its place among those that are shown, from 0."""
    return _MAPPING_COLOURS[number % len(_MAPPING_COLOURS)]


def spans_figure(spans: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Figure:
    """Return a panel per client with a stacked bar per mapping: the mean ms of each stage.

    `spans[mapping][client][stage]` is the mean time in ms; the stages of one cell sum to its round trip.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  see the module docstring

    clients = list(dict.fromkeys(client for row in spans.values() for client in row))
    colours = stage_colours(stage for row in spans.values() for cell in row.values() for stage in cell)
    places = range(len(spans))
    with drawing_style():
        lines = -(-len(colours) // _LEGEND_COLUMNS)
        size = max(1.9 * len(clients) + 1.2, 10.0), 0.4 * len(spans) + 0.2 * lines + 1.0
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.subplots(1, len(clients), squeeze=False, sharey=True)[0]
        for axes, client in zip(grid, clients, strict=True):
            left = np.zeros(len(spans))
            for stage, colour in colours.items():
                widths = np.array([row.get(client, {}).get(stage, 0.0) for row in spans.values()])
                axes.barh(places, widths, left=left, height=0.62, label=stage, color=colour)
                left += widths
            for place, total in zip(places, left.tolist(), strict=True):
                if total:
                    axes.annotate(f" {format_ms(total)}", (total, place), va="center", fontsize=8)
            axes.set_title(wrapped(client, 18), loc="left", fontweight="bold")
            axes.set_xlim(0, left.max() * 1.25 or 1.0)
            axes.locator_params(axis="x", nbins=4)
            axes.set_yticks(places, [wrapped(mapping, 24) for mapping in spans])
        grid[0].invert_yaxis()
        figure.supxlabel("mean time [ms]")
        handles, labels = grid[0].get_legend_handles_labels()
        # A legend is filled column by column; the way of a message is read line by line.
        order = [i for first in range(_LEGEND_COLUMNS) for i in range(first, len(labels), _LEGEND_COLUMNS)]
        figure.legend(
            [handles[i] for i in order],
            [labels[i] for i in order],
            loc="outside upper left",
            ncols=_LEGEND_COLUMNS,
        )
    return figure


def write_grid(path: Path, records: Mapping[str, Mapping[str, Record]]) -> None:
    """Write the grid of `grid_figure` to a `.png` or `.svg` file.

    Raises UsageError for another suffix, if the file cannot be written, or if there is no record.
    """
    if not any(records.values()):
        raise UsageError(f"{path}: there is no record to draw. Run the experiment first.")
    write_figure(grid_figure(records), path, ("png", "svg"))


def write_histograms(path: Path, pairs: Sequence[tuple[NamedRecord, NamedRecord | None]], bins: int) -> None:
    """Write a `.png` file with one histogram per record, the distribution to compare with behind it in grey.

    The same bins as in the terminal. Raises UsageError for another suffix or if the file cannot be written.
    """
    if path.suffix.lower() != ".png":
        raise UsageError(f"{path}: histograms are written as png. Name the file *.png.")
    from matplotlib.figure import Figure  # noqa: PLC0415  see the module docstring

    columns = min(len(pairs), 3)
    rows = -(-len(pairs) // columns)
    with drawing_style():
        figure = Figure(figsize=(4.2 * columns + 0.5, 2.4 * rows + 0.8), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False).flatten()
        for axes, (entry, other) in zip(grid, pairs, strict=False):
            edges_ms = bin_edges([e.record.values_ms for e in (entry, other) if e], bins)
            behind = _shares(other.record, edges_ms) if other and other.record.values_ms.size else None
            _panel(axes, edges_ms, entry.record, behind, _MAPPING_COLOURS[1])
            # The empty line makes room for the medians.
            axes.set_title(f"{wrapped(entry.name, 42)}\n", loc="left", fontweight="bold")
            other_ms = float(np.median(other.record.values_ms)) if behind is not None and other else None
            axes.set_title(_medians(entry.record, "other", other_ms), loc="right", fontsize=8)
        for axes in grid[len(pairs) :]:
            axes.set_axis_off()
        figure.supxlabel("time [ms]; above each panel its median")  # of any kind
        figure.supylabel("relative frequency")
        behind_any = "compared with" if any(other for _, other in pairs) else None
        _legend(figure, "record", behind_any, _MAPPING_COLOURS[1:2])
    write_figure(figure, path)


def draw_histogram(axes: Axes, record: Record, edges_ms: npt.NDArray[np.float64], title: str) -> None:
    """Draw the record's histogram in the style around it, with its mean, and its median above it."""
    _panel(axes, edges_ms, record, None, _MAPPING_COLOURS[1])
    axes.set_title(f"{wrapped(title, 42)}\n", loc="left", fontweight="bold")
    mean = format_ms(float(record.values_ms.mean()))
    axes.set_title(f"median {_medians(record, '', None)}, mean {mean} ms (dashed)", loc="right", fontsize=8)


def inline_svg(figure: Figure) -> str:
    """Return the figure as an SVG element for an HTML page, without references to the outside.

    Ink and grey are the CSS variables `--ink` and `--grey` of the page, so the drawing follows its light or
    dark scheme.
    """
    buffer = io.StringIO()
    with drawing_style():
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:xlink)?="[^"]*"', "", svg).replace("xlink:href", "href")
    svg = re.sub(r' width="[^"]*pt" height="[^"]*pt"|height="[^"]*pt" ', "", svg, count=1)
    return svg.replace(INK, "var(--ink)").replace(GREY, "var(--grey)")


def write_figure(figure: Figure, path: Path, formats: Sequence[str] = ("png",)) -> None:
    """Write the figure in the format that the file's suffix names, one of these.

    Raises UsageError for another suffix or if the file cannot be written.
    """
    suffix = path.suffix.lower().removeprefix(".")
    if suffix not in formats:
        raise UsageError(
            f"{path}: drawings are written as {' or '.join(formats)}. Name the file *.{formats[0]}."
        )
    buffer = io.BytesIO()
    with drawing_style():
        figure.savefig(buffer, format=suffix, dpi=160)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if suffix == "png":
            # Few colours: a third of the size, and nothing of it to be seen.
            Image.open(buffer).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(
                path, optimize=True
            )
        else:
            path.write_bytes(buffer.getvalue())
    except OSError as error:
        raise UsageError(
            f"{path}: the drawing cannot be written: {error.strerror}. Choose a folder that you may write to."
        ) from error


def drawing_style() -> AbstractContextManager[None]:
    """Return a context in which figures look alike; they are drawn in it and written in it."""
    import matplotlib as mpl  # noqa: PLC0415  see the module docstring

    return mpl.rc_context(
        {
            "font.family": "DejaVu Sans",
            "font.size": 9,
            "text.color": INK,
            "text.parse_math": False,  # a $ in a name is a $
            "axes.edgecolor": GREY,
            "axes.labelcolor": INK,
            "axes.spines.right": False,
            "axes.spines.top": False,
            "axes.titlesize": 10,
            "figure.labelsize": 9,
            "legend.frameon": False,
            "xtick.color": INK,
            "ytick.color": INK,
            "xtick.labelsize": 8,
            "ytick.labelsize": 8,
            "svg.hashsalt": "reconros",
        }
    )


def _panel(
    axes: Axes,
    edges_ms: npt.NDArray[np.float64],
    record: Record | None,
    behind: npt.NDArray[np.float64] | None,
    colour: str,
) -> None:
    from matplotlib.ticker import LogLocator, NullLocator  # noqa: PLC0415  see the module docstring

    axes.locator_params(axis="both", nbins=4)
    axes.yaxis.set_major_formatter(lambda share, _: f"{100 * share:g} %")
    notes = []
    if edges_ms.size:
        if edges_ms[-1] - edges_ms[-2] > 1.01 * (edges_ms[1] - edges_ms[0]):
            notes.append("log axis")
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlim(edges_ms[0], edges_ms[-1])
    if behind is not None:
        axes.stairs(behind, edges_ms, fill=True, color=GREY, alpha=0.45)
        axes.stairs(behind, edges_ms, color=GREY, linewidth=0.8, zorder=3)
    if record is None or not record.values_ms.size:
        text = f"no answer\n({record.lost} lost)" if record else "not run"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
        axes.set_xlabel(", ".join(notes), loc="right", fontsize=7.5)
        return
    shares = _shares(record, edges_ms)
    axes.stairs(shares, edges_ms, fill=True, color=colour, alpha=0.6)
    axes.stairs(shares, edges_ms, color=colour, linewidth=0.8)
    mean_ms = float(record.values_ms.mean())
    if mean_ms <= edges_ms[-1]:
        axes.axvline(mean_ms, color=INK, linestyle="--", linewidth=0.9)
    else:
        notes.append(f"mean {format_ms(mean_ms)} ms →")
    outside = 1 - float(shares.sum())
    if outside >= 0.0005:
        notes.append(f"{100 * outside:.1f} % outside")
    axes.set_xlabel(", ".join(notes), loc="right", fontsize=7.5)


def _shares(record: Record, edges_ms: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return count(record.values_ms, edges_ms).counts / record.values_ms.size


def _grid_edges(records: Mapping[str, Mapping[str, Record]], client: str) -> npt.NDArray[np.float64]:
    """Return bins over a range that suits the client under all mappings and on the real board, or none.

    Geometric bins where the mappings are so far apart that equal bins would show the fast ones as one bar.
    """
    points = []  # low end, median and high end of each distribution
    for mapping, of_mapping in records.items():
        if client in of_mapping and of_mapping[client].values_ms.size:
            points.append(np.percentile(of_mapping[client].values_ms, _GRID_PERCENTILES))
        if reference := reference_cells().get(mapping, {}).get(client):
            points.append(np.array([reference.percentile(p) for p in _GRID_PERCENTILES]))
    if not points:
        return np.array([], dtype=np.float64)
    lows, medians, highs = np.array(points).T
    low, high = float(lows.min()), float(highs.max())
    if low > 0 and medians.max() > FAR_APART * medians.min():
        return np.geomspace(0.9 * low, 1.1 * high, _GRID_BINS + 1)
    margin = 0.04 * (high - low) or 0.5
    return np.linspace(0.0 if low < 0.3 * high else low - margin, high + margin, _GRID_BINS + 1)


def _medians(record: Record | None, other: str, other_ms: float | None) -> str:
    ours = f"{format_ms(float(np.median(record.values_ms)))} ms" if record and record.values_ms.size else ""
    return ours if other_ms is None else f"{ours} ({other} {format_ms(other_ms)})"


def wrapped(name: str, width: int) -> str:
    """Return the name in lines, broken after underscores where it can be."""
    return textwrap.fill(name.replace("_", "_ "), width).replace("_ ", "_")


def _legend(figure: Figure, ours: str, behind: str | None, colours: Sequence[str]) -> None:
    from matplotlib.legend_handler import HandlerTuple  # noqa: PLC0415  see the module docstring
    from matplotlib.lines import Line2D  # noqa: PLC0415
    from matplotlib.patches import Patch  # noqa: PLC0415

    handles: dict[str, Any] = {  # by label; matplotlib knows of tuples, its types do not
        ours: tuple(Patch(color=colour, alpha=0.6) for colour in colours),
        "its mean": Line2D([], [], color=INK, linestyle="--", linewidth=0.9),
    }
    if behind:
        handles[behind] = Patch(color=GREY, alpha=0.45)
    figure.legend(
        handles.values(),
        handles,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0)},
        loc="outside upper left",
        ncols=len(handles),
    )


def stage_colours(stages: Iterable[str]) -> dict[str, str]:
    """Return a colour per stage, in the order of a message's way; stages of other names are grey and last."""
    found = dict.fromkeys(stages, GREY)
    return {stage: colour for stage, colour in STAGE_COLOURS.items() if stage in found} | {
        stage: GREY for stage in found if stage not in STAGE_COLOURS
    }
