"""The drawing of mappings compared: how old what leaves the board is, mapping by mapping."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reconros_zenoh.measure.plots import FAR_APART, drawing_style, mapping_colour, wrapped

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy.typing as npt
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 3
_LINES = ("-", "--", ":", "-.")
_LETTERS = 34  # of a topic above its panel, of a mapping in the legend
_LETTER, _KEY = 0.07, 0.6
"""Widths of a letter in the legend, and of a line with the blanks around it [inch]."""
_MANY_DECADES = 1000.0


def ages_figure(ages_ms: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Return a panel per topic: the share of its messages that are at most so old, a line per mapping.

    `ages_ms[mapping][topic]` holds the ages [ms]; topics without any in all mappings have no panel.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  takes a second, as in plots.py

    first, *_ = ages_ms.values()
    topics = [topic for topic in first if any(of_mapping[topic] for of_mapping in ages_ms.values())]
    columns = min(_COLUMNS, len(topics))
    rows = -(-len(topics) // columns)
    width = 3.4 * columns + 1.0
    widest = _KEY + _LETTER * min(_LETTERS, max(map(len, ages_ms)))
    keys_in_row = max(1, int(width / widest))
    with drawing_style():
        height = 2.3 * rows + 0.25 * -(-len(ages_ms) // keys_in_row) + 0.7
        figure = Figure(figsize=(width, height), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
        panels = list(grid.flat)
        for axes in panels[len(topics) :]:
            axes.set_axis_off()
        for axes, topic in zip(panels, topics, strict=False):
            sorted_ms = {name: np.sort(np.array(of[topic], np.float64)) for name, of in ages_ms.items()}
            _draw_ages(axes, sorted_ms)
            axes.set_title(wrapped(topic, _LETTERS), loc="left", fontweight="bold")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(
            handles,
            [wrapped(label, _LETTERS) for label in labels],
            loc="outside upper left",
            ncols=keys_in_row,
        )
        figure.supxlabel("age when it leaves the board [ms]")
        for axes in grid[:, 0]:
            axes.set_ylabel("share at most so old")
    return figure


def _draw_ages(axes: Axes, sorted_ms: Mapping[str, npt.NDArray[np.float64]]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter  # noqa: PLC0415

    for number, (mapping, ages) in enumerate(sorted_ms.items()):
        from_zero = np.append(ages[:1], ages)  # a line for one message, too
        axes.step(
            from_zero,
            np.arange(from_zero.size) / max(1, ages.size),
            _LINES[number % len(_LINES)],
            where="post",
            color=mapping_colour(number),
            label=mapping,
        )
    every = np.concatenate(list(sorted_ms.values()))
    apart = every.max() / every.min() if every.min() else 1.0
    if apart > FAR_APART:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if apart < _MANY_DECADES else (1,)))
        axes.xaxis.set_minor_formatter(NullFormatter())
    else:
        axes.locator_params(axis="x", nbins=5)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_ylim(0, 1.03)
