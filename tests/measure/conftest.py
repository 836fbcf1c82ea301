from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from board_like_runs import experiment_of, like_the_board

from reconros_zenoh.measure.record import Record, RecordWriter, RoundTrip
from reconros_zenoh.measure.reference.zynq7100 import reference_cells

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path


@pytest.fixture
def board_records() -> dict[str, dict[str, Record]]:
    return {m: {c: like_the_board(m, c) for c in cells} for m, cells in reference_cells().items()}


@pytest.fixture
def write_run(tmp_path: Path) -> Callable[..., Path]:
    """Writes a run folder as an experiment does."""

    def write(records: Mapping[str, Mapping[str, Record]], clock: str = "virtual", **more: Any) -> Path:
        folder = tmp_path / clock
        for mapping, clients in records.items():
            for client, record in clients.items():
                with RecordWriter(folder / mapping / f"{client}.csv") as writer:
                    for index, value in enumerate(record.values_ms):
                        writer.write(RoundTrip(index, round(value * 1e6), "ok"))
                    for index in range(record.lost):
                        writer.write(RoundTrip(record.values_ms.size + index, None, "lost"))
        (folder / "experiment.json").write_text(json.dumps(experiment_of(records, clock, **more)))
        return folder

    return write
