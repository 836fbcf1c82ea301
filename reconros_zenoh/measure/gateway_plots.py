"""Drawings of the gateway experiment, after Figs. 6 and 7 of the gateways paper."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {"smt": "#2f7ec4", "gateway": "#d2691e"}
_LINES = ("-", "--", ":", "-.")
_SIDES = (("hardware", "hw", "hw_max_ms"), ("software", "sw", "sw_ms"))


def transmission_figure(cells: Sequence[dict[str, Any]], publisher: str) -> Figure:
    """Return times (above) and speedups (below) over the message size, to hardware (left) and to software.

    `cells` are those of the experiment's JSON. The line style is the number of hardware subscribers. The
    figures of the paper are lost: what they show is known from its text.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  takes a second, as in plots.py

    figure = Figure(figsize=(10, 7), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    chosen = [cell for cell in cells if cell["publisher"] == publisher]
    for column, (place, side, time) in enumerate(_SIDES):
        _draw(axes[0][column], axes[1][column], chosen, side, time)
        axes[0][column].set_title(f"{publisher} to {place}")
    axes[0][0].set_ylabel("transmission time [ms]")
    axes[1][0].set_ylabel("speedup by the gateway")
    axes[0][0].legend(fontsize="small")
    return figure


def _draw(times: Axes, speedups: Axes, cells: Sequence[dict[str, Any]], side: str, time: str) -> None:
    counts = sorted({cell["subscribers"] for cell in cells})
    for number, count in enumerate(counts):
        row = sorted((cell for cell in cells if cell["subscribers"] == count), key=lambda cell: cell["size"])
        sizes = [cell["size"] / 1000 for cell in row]
        style = _LINES[number % len(_LINES)]
        for variant, colour in _COLOURS.items():
            times.plot(
                sizes,
                [cell[variant][time] for cell in row],
                style,
                color=colour,
                marker="o",
                label=f"{variant}, {count} in hardware",
            )
        speedups.plot(sizes, [cell[f"speedup_{side}"] for cell in row], style, color="#24292f", marker="o")
    times.set_xscale("log")
    times.set_yscale("log")
    speedups.axhline(1, color="#8b949e", linewidth=0.8)
    speedups.set_xlabel("message [kB]")
    for axes in (times, speedups):
        axes.grid(visible=True, alpha=0.3)
