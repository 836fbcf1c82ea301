"""Drawings for a notebook; importing this loads matplotlib."""

from __future__ import annotations

import io
import reprlib
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.histogram import bin_edges
from reconros_zenoh.measure.plots import draw_histogram, drawing_style
from reconros_zenoh.measure.record import Record

if TYPE_CHECKING:
    import numpy.typing as npt


class NotebookFigure(Figure):
    """A matplotlib figure that a notebook shows by itself; `savefig` writes it to a file."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=110)
        return buffer.getvalue()


def histogram(times_ms: npt.ArrayLike, title: str = "", bins: int = 40) -> Figure:
    """Return a histogram of times [ms], with mean and median; NaN stands for a lost answer.

    Raises UsageError for what are no times, and where all answers are lost.
    """
    try:
        values_ms = np.asarray(times_ms, np.float64).reshape(-1)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{reprlib.repr(times_ms)} are no times: {error}. Give numbers [ms].") from None
    known = values_ms[~np.isnan(values_ms)]
    if not np.isfinite(known).all():
        raise UsageError("a time without end cannot be drawn. Give NaN for an answer that did not come.")
    if not known.size:
        raise UsageError("a histogram of no times cannot be drawn. Measure some first.")
    record = Record(title, known, lost=values_ms.size - known.size)
    with drawing_style():
        figure = NotebookFigure(figsize=(6, 3), layout="constrained")
        draw_histogram(figure.subplots(), record, bin_edges([known], bins), title)
        figure.supxlabel("time [ms]")
        figure.supylabel("relative frequency")
    return figure
