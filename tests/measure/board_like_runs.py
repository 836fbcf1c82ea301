"""Records and experiments that look like the real board's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.measure.compare import experiment_tables
from reconros_zenoh.measure.record import Record
from reconros_zenoh.measure.reference.zynq7100 import reference_cells

if TYPE_CHECKING:
    from collections.abc import Mapping


def like_the_board(mapping: str, client: str, factor: float = 1.0, n: int = 201) -> Record:
    """A record whose times are the real board's percentiles times a factor."""
    cell = reference_cells()[mapping][client]
    values = np.array([cell.percentile(p) for p in np.linspace(0, 100, n)]) * factor
    return Record(client, values)


def experiment_of(
    records: Mapping[str, Mapping[str, Record]], clock: str = "virtual", **more: Any
) -> dict[str, Any]:
    lag_us = (10.0, 90.0) if clock == "wall" else (None, None)
    host = {"overruns": 0, "lag_p50_us": lag_us[0], "lag_p99_us": lag_us[1]}
    return {
        "experiment": "roundtrip",
        "clock": clock,
        "requests": 201,
        "seed": 7,
        **experiment_tables(records),
        "host": host,
        **more,
    }
