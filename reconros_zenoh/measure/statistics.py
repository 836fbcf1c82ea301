"""The figures that stand for a set of round-trip times, and how they are written."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

EXPERIMENT_PERCENTILES = {
    "p5_ms": 5.0,
    "p25_ms": 25.0,
    "median_ms": 50.0,
    "p75_ms": 75.0,
    "p95_ms": 95.0,
    "p99_ms": 99.0,
    "max_ms": 100.0,
}


def summarise(
    values_ms: npt.NDArray[np.float64],
    lost: int,
    wrong: int,
    percentiles: Mapping[str, float] = EXPERIMENT_PERCENTILES,
) -> dict[str, float | int | None]:
    """Return n, lost, wrong, mean_ms and the percentiles under their names.

    By default these are p5_ms, p25_ms, median_ms, p75_ms, p95_ms, p99_ms and max_ms. `n` counts the answers,
    wrong ones included; the times are over these answers and None if there was none. Percentiles are
    interpolated linearly.
    """
    counts: dict[str, float | int | None] = {"n": int(values_ms.size), "lost": lost, "wrong": wrong}
    if not values_ms.size:
        return counts | dict.fromkeys(("mean_ms", *percentiles))
    points = np.percentile(values_ms, list(percentiles.values()))
    return (
        counts | {"mean_ms": float(values_ms.mean())} | dict(zip(percentiles, points.tolist(), strict=True))
    )


def format_ms(value: float | None) -> str:
    """Return the time as `format_part` does, but below 0.1 ms with two significant digits, as far as 1 ns."""
    if value is not None and 0 < value < 0.1:
        return f"{value:.{min(6, 1 - math.floor(math.log10(value)))}f}"
    return format_part(value)


def format_part(value: float | None) -> str:
    """Return the time, one of several that are compared or added, with two decimals, from 100 ms on with one.

    `-` stands for None.
    """
    if value is None:
        return "-"
    return f"{value:.{2 if value < 100 else 1}f}"


def format_error(error: float | None) -> str:
    """Return the relative error as a signed percentage, `-` for None."""
    return "-" if error is None else f"{error:+.1%}".replace("%", " %")


def format_share(share: float | None) -> str:
    """Return the share as a percentage, `-` for None."""
    return "-" if share is None else f"{share:.1%}".replace("%", " %")


def format_speedup(speedup: float | None) -> str:
    """Return the speedup with two decimals, `-` for None."""
    return "-" if speedup is None else f"{speedup:.2f}"
