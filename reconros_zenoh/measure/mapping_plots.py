"""The drawing of mappings compared: how old what leaves the board is, mapping by mapping."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reconros_zenoh.measure.plots import drawing_style, mapping_colour

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

_COLUMNS = 3
_LINES = ("-", "--", ":", "-.")


def ages_figure(ages_ms: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Return a panel per topic: the share of its messages that are at most so old, a line per mapping.

    `ages_ms[mapping][topic]` holds the ages [ms]; topics without any in all mappings have no panel.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  takes a second, as in plots.py
    from matplotlib.ticker import LogLocator, NullFormatter  # noqa: PLC0415

    first, *_ = ages_ms.values()
    topics = [topic for topic in first if any(of_mapping[topic] for of_mapping in ages_ms.values())]
    columns = min(_COLUMNS, len(topics))
    rows = -(-len(topics) // columns)
    with drawing_style():
        figure = Figure(figsize=(3.4 * columns + 0.6, 2.3 * rows + 0.9), layout="constrained")
        panels = list(figure.subplots(rows, columns, squeeze=False, sharey=True).flat)
        for axes in panels[len(topics) :]:
            axes.set_axis_off()
        for axes, topic in zip(panels, topics, strict=False):
            for number, (mapping, of_mapping) in enumerate(ages_ms.items()):
                ages = np.sort(np.asarray(of_mapping[topic], np.float64))
                axes.step(
                    ages,
                    np.arange(1, ages.size + 1) / max(1, ages.size),
                    _LINES[number % len(_LINES)],
                    where="post",
                    color=mapping_colour(number),
                    label=mapping,
                )
            axes.set_title(topic, loc="left", fontweight="bold")
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=6))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.set_ylim(0, 1.03)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
        figure.supxlabel("age when it leaves the board [ms]")
        figure.supylabel("share at most so old")
    return figure
