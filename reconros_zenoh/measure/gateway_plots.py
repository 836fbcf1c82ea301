"""Drawings of the gateway experiment, after Figs. 6 and 7 of the gateways paper."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any, Literal

from reconros_zenoh.measure.plots import GREY, INK, drawing_style

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_VARIANTS = {"smt": ("SMT", "#2f7ec4"), "gateway": ("with a gateway", "#d2691e")}
_Line = Literal["-", "--", ":", "-."]
_STYLES: tuple[tuple[_Line, str], ...] = (("-", "o"), ("--", "s"), (":", "^"), ("-.", "D"))
_SIDES = (
    ("hardware, slowest subscriber", "hw", "hw_max_ms"),
    ("software", "sw", "sw_ms"),
)


def transmission_figure(result: Mapping[str, Any], publisher: str) -> Figure:
    """Return times (above) and speedups (below) over the message size, to hardware (left) and to software.

    `result` is the experiment's JSON; its profile and clock stand below. Line and marker tell the number of
    hardware subscribers. The figures of the paper are lost: what they show is known from its text.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  takes a second, as in plots.py

    chosen = [cell for cell in result["cells"] if cell["publisher"] == publisher]
    with drawing_style():
        figure = Figure(figsize=(9, 6), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True)
        for column, (place, side, time) in enumerate(_SIDES):
            _draw(axes[0][column], axes[1][column], chosen, side, time)
            axes[0][column].set_title(f"{publisher} to {place}", loc="left", fontweight="bold")
        axes[0][0].set_ylabel("transmission time [ms]")
        axes[1][0].set_ylabel("speedup by the gateway")
        figure.supxlabel(f"message size; profile {result['profile']}, {result['clock']} time")
        _legend(figure, sorted({cell["subscribers"] for cell in chosen}))
    return figure


def _draw(times: Axes, speedups: Axes, cells: Sequence[dict[str, Any]], side: str, time: str) -> None:
    from matplotlib.ticker import LogLocator, NullLocator  # noqa: PLC0415

    for number, count in enumerate(sorted({cell["subscribers"] for cell in cells})):
        row = sorted((cell for cell in cells if cell["subscribers"] == count), key=lambda cell: cell["size"])
        sizes = [cell["size"] for cell in row]
        style, marker = _STYLES[number % len(_STYLES)]
        for variant, (_, colour) in _VARIANTS.items():
            values_ms = [cell[variant][time] for cell in row]
            times.plot(sizes, values_ms, style, color=colour, marker=marker, markersize=4)
        values = [cell[f"speedup_{side}"] for cell in row]
        speedups.plot(sizes, values, style, color=INK, marker=marker, markersize=4)
    times.set_xscale("log")
    times.set_yscale("log")
    times.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    times.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    times.yaxis.set_minor_locator(NullLocator())
    speedups.axhline(1, color=GREY, linewidth=0.8)
    every = sorted({cell["size"] for cell in cells})
    for axes in (times, speedups):
        axes.set_xticks(every, [_size(size) for size in every])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(visible=True, alpha=0.3)


def _legend(figure: Figure, counts: Sequence[int]) -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415

    handles = [Line2D([], [], color=colour, label=name) for name, colour in _VARIANTS.values()]
    handles += [
        Line2D(
            [],
            [],
            color=INK,
            linestyle=style,
            marker=marker,
            markersize=4,
            label=f"hardware subscribers: {count}",
        )
        for (style, marker), count in zip(cycle(_STYLES), counts, strict=False)
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(handles))


def _size(count: int) -> str:
    """Return the number of bytes as `--sizes` takes it."""
    for unit, name in ((10**6, "MB"), (1000, "kB")):
        if count >= unit:
            return f"{count / unit:g} {name}"
    return f"{count} B"
