from __future__ import annotations

import numpy as np
import pytest

from reconros_zenoh.measure.reference.zynq7100 import (
    PRINTED_SPEEDUPS_OF_MEANS,
    SWAPPED_COLUMNS,
    reference_cells,
    reference_notes,
)

MEDIANS_MS = {
    "inverse": (18.24, 2.51, 2.65),
    "mnist": (19.84, 16.85, 16.93),
    "sobel": (151.61, 118.84, 152.03),
    "sort": (51.74, 2.63, 2.58),
    "hash": (249.93, 248.52, 249.86),
}
CELLS = [(mapping, client) for mapping, row in reference_cells().items() for client in row]


def test_the_medians_are_those_of_the_real_board():
    cells = reference_cells()
    assert list(cells) == ["all_software", "mixed", "all_hardware"]
    assert len(CELLS) == 15
    for client, medians in MEDIANS_MS.items():
        for row, median in zip(cells.values(), medians, strict=True):
            # Both are rounded: the table to 0.01 ms, the percentile to 0.001 ms.
            assert row[client].median_ms == pytest.approx(median, abs=0.0056)


@pytest.mark.parametrize(("mapping", "client"), CELLS)
def test_every_cell_is_a_distribution(mapping, client):
    cell = reference_cells()[mapping][client]
    assert cell.percentiles_ms.shape == (201,)
    assert np.all(np.diff(cell.percentiles_ms) >= 0)
    assert (cell.percentile(0), cell.percentile(100)) == (cell.min_ms, cell.max_ms)
    assert cell.min_ms < cell.mean_ms < cell.max_ms < 1000
    assert cell.n in {999, 1000}
    edges = np.linspace(0, 1000, 101)
    density = cell.density(edges)
    assert density.shape == (100,)
    assert density.min() >= 0
    assert density.sum() == pytest.approx(1)
    half = cell.density(np.array([0, cell.median_ms, 1000]))
    assert half == pytest.approx([0.5, 0.5])


def test_the_printed_columns_are_swapped():
    cells = reference_cells()
    printed = PRINTED_SPEEDUPS_OF_MEANS
    for client in ("sort", "inverse", "sobel", "mnist", "hash"):
        software = cells["all_software"][client].mean_ms
        assert software / cells["all_hardware"][client].mean_ms == pytest.approx(
            printed["mixed"][client], abs=0.011
        )
    software = cells["all_software"]["sort"].mean_ms
    assert software / cells["mixed"]["sort"].mean_ms == pytest.approx(
        printed["all_hardware"]["sort"], abs=0.011
    )
    assert "swapped" in SWAPPED_COLUMNS


def test_source_and_traps_are_told():
    notes = " ".join(reference_notes())
    for word in ("Section V-C", "values[1:-1]", "modulo 1 s", "retransmissions", "250 ms timer"):
        assert word in notes
