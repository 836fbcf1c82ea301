"""The drawing of the driving experiment: where the chain's time goes, and what the robot sees and does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.measure.plots import GREY, INK, drawing_style

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

_NAMES = {
    "all_software": "all topics in memory",
    "hardware_topics": "streams between nodes\nin hardware",
    "gateways": "streams, and a gateway",
}
_COLOURS = ("#7fa6dc", "#a9d469", "#eba51b", "#df7b5f")


def driving_figure(
    experiment: Mapping[str, Any],
    drive: Sequence[tuple[float, float, bool]],
    pictures: Mapping[str, NDArray[np.uint8]],
) -> Figure:
    """Return the chain of each variant by section, below it two pictures and the drive with the last variant.

    `experiment` is the experiment's JSON, `drive` has time [s], speed [m/s] and whether the light was red.
    The pictures, by their titles, have red, green and blue, or grey only.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  takes a second, as in plots.py

    with drawing_style():
        figure = Figure(figsize=(10, 6), layout="constrained")
        grid = figure.add_gridspec(2, len(pictures) + 1, height_ratios=(5, 4))
        _draw_chains(figure.add_subplot(grid[0, :]), experiment["variants"])
        *frames, speed = (figure.add_subplot(grid[1, column]) for column in range(len(pictures) + 1))
        for axes, (title, picture) in zip(frames, pictures.items(), strict=True):
            axes.imshow(picture, cmap="gray")
            axes.set_axis_off()
            axes.set_title(title, loc="left")
        _draw_speed(speed, drive)
    return figure


def _draw_chains(axes: Axes, variants: Mapping[str, Mapping[str, Any]]) -> None:
    for row, measured in enumerate(variants.values()):
        left = 0.0
        for colour, (section, mean_ms) in zip(_COLOURS, measured["sections_ms"].items(), strict=True):
            middle = left + mean_ms / 2
            axes.barh(row, mean_ms, left=left, color=colour, height=0.6)
            axes.text(middle, row, f"{mean_ms:.1f}", ha="center", va="center")
            if row == 0:
                name = section.replace("_", " ").replace(" to ", "\nto ")
                axes.text(middle, row - 0.35, name, ha="center", va="bottom", color=GREY)
            left += mean_ms
        paper_ms = measured["paper_mean_ms"]
        text = f"{left:.2f} ms"
        if paper_ms is not None:
            axes.plot([paper_ms, paper_ms], [row - 0.4, row + 0.4], "--", color=INK)
            text += f", the paper's board {paper_ms:.2f}"
        axes.text(max(left, paper_ms or 0) + 0.3, row, text, va="center", fontweight="bold")
    axes.set_yticks(range(len(variants)), [_NAMES[name] for name in variants])
    axes.invert_yaxis()
    axes.set_xlim(0, 1.3 * max(variant["chain_mean_ms"] for variant in variants.values()))
    axes.set_xlabel("from one node having a picture to the next one having what was made of it [ms]")
    axes.set_title("From Image Compensation to Lane Control", loc="left", fontweight="bold", pad=24)


def _draw_speed(axes: Axes, drive: Sequence[tuple[float, float, bool]]) -> None:
    seconds, speeds, red = zip(*drive, strict=True)
    axes.fill_between(seconds, 0, 1, where=red, step="post", color="#c2485a", alpha=0.25, linewidth=0)
    axes.step(seconds, speeds, where="post", color=INK)
    axes.set_ylim(0, 0.6)
    axes.set_xlabel("time [s]; red: the traffic light", color=GREY)
    axes.set_title("speed [m/s]", loc="left")
