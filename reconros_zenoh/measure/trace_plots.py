"""The drawing of a trace: which part of a board did what, over time."""

from __future__ import annotations

from colorsys import hsv_to_rgb
from itertools import count
from typing import TYPE_CHECKING

from reconros_zenoh.measure.plots import GREY, STAGE_COLOURS, drawing_style

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from reconros_zenoh.board.trace import Slice, Trace

_DRAWN_NS = 1_000_000_000
_RECONFIGURATION = STAGE_COLOURS["reconfiguration"]
_WAYS = {"in": GREY, "out": "#c9ced6"}
_HEIGHT = 0.72
_HUE_STEP = 0.618034  # golden section of the circle: neighbours are far apart, and none comes again
_LEGEND_LETTERS = 50  # of the callbacks in a row, beside the other keys
_COLOURS = (
    "#d2691e",
    "#2f7ec4",
    "#2a9267",
    "#9463c0",
    "#c2485a",
    "#8a7a1f",
    "#17a5b8",
    "#e377c2",
    "#5b4a3f",
    "#86b81b",
    "#1b3a6b",
    "#e8b923",
)


def trace_figure(board: str, trace: Trace) -> Figure:
    """Return the last second of a trace, a line per track from the first to the last worker, ICAP and stack.

    Calls have the colour of their callback, full where they compute and pale where they wait or transfer;
    reconfigurations are hatched, from when the worker asks for one until it has it.
    """
    from matplotlib.patches import Patch  # noqa: PLC0415  takes a second, as in plots.py

    from reconros_zenoh.measure.notebook import NotebookFigure  # noqa: PLC0415

    slices = list(trace.slices())
    end_ns = max((each.end_ns for each in slices), default=0)
    begin_ns = max(0, end_ns - _DRAWN_NS)
    slices = [each for each in slices if each.end_ns >= begin_ns]
    names = [track.name for track in trace.tracks]
    shared = (trace.icap.name, trace.stack.name)
    callbacks = sorted({each.name for each in slices if each.track not in shared})
    colours = dict(zip(callbacks, _callback_colours(), strict=False))
    with drawing_style():
        figure = NotebookFigure(figsize=(10, 0.42 * len(names) + 1.3), layout="constrained")
        axes = figure.subplots()
        for line, name in enumerate(names):
            _draw_track(axes, line, [each for each in slices if each.track == name], colours)
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_xlim(begin_ns / 1e6, max(end_ns, begin_ns + 1) / 1e6)
        axes.set_xlabel(f"time since {board} began [ms]")
        keys = [Patch(color=colour, label=name) for name, colour in colours.items()]
        keys.append(
            Patch(facecolor="white", edgecolor=_RECONFIGURATION, hatch="////", label="reconfiguration")
        )
        keys += [Patch(color=colour, label=f"message {way}") for way, colour in _WAYS.items()]
        rows = 1 + sum(len(name) for name in callbacks) // _LEGEND_LETTERS
        figure.legend(handles=keys, loc="outside upper left", ncols=-(-len(keys) // rows))
    return figure


def _callback_colours() -> Iterator[str]:
    """Yield colours that differ, without end: twelve that were chosen, then brighter ones."""
    from matplotlib.colors import to_hex  # noqa: PLC0415  as above

    yield from _COLOURS
    for number in count():
        yield to_hex(hsv_to_rgb(number * _HUE_STEP % 1, 0.8, 1.0))


def _draw_track(axes: Axes, line: int, slices: Sequence[Slice], colours: dict[str, str]) -> None:
    bottom = line - _HEIGHT / 2
    axes.axhline(line, color=GREY, linewidth=0.4, zorder=0)
    for name, colour in (colours | _WAYS).items():
        mine = [each for each in slices if each.name == name]
        # What computes nothing, as a bitstream that is loaded, is full; of a call only what computes.
        calls, stages = [e for e in mine if not e.stage], [e for e in mine if e.stage == "execution"]
        pale = 0.35 if any(each.stage for each in mine) else 1.0
        axes.broken_barh(_spans(calls), (bottom, _HEIGHT), color=colour, linewidth=0.5, alpha=pale)
        axes.broken_barh(_spans(stages), (bottom, _HEIGHT), color=colour, linewidth=0.5)
    axes.broken_barh(
        _spans([each for each in slices if each.stage == "reconfiguration" and each.end_ns > each.begin_ns]),
        (bottom, _HEIGHT),
        facecolor="white",
        edgecolor=_RECONFIGURATION,
        hatch="////",
        linewidth=0.8,
    )


def _spans(slices: Sequence[Slice]) -> list[tuple[float, float]]:
    return [(each.begin_ns / 1e6, (each.end_ns - each.begin_ns) / 1e6) for each in slices]
