from __future__ import annotations

import io
import json

import numpy as np
import pytest
from board_like_runs import experiment_of, like_the_board
from rich.console import Console

from reconros_zenoh.measure.compare import experiment_tables, grade, print_tables
from reconros_zenoh.measure.record import Record
from reconros_zenoh.measure.reference.zynq7100 import reference_cells


def printed(experiment, **options):
    stream = io.StringIO()
    print_tables(Console(file=stream, width=80, **options), experiment)
    return stream.getvalue()


def test_the_board_compared_with_itself_has_no_error(board_records):
    tables = experiment_tables(board_records)
    for mapping, row in tables["mappings"].items():
        for client, cell in row.items():
            assert cell["reference_median_ms"] == reference_cells()[mapping][client].median_ms
            assert cell["median_error"] == pytest.approx(0, abs=1e-3)
    assert tables["speedup_of_medians"]["mixed"]["sort"] == pytest.approx(51.74 / 2.63, rel=1e-2)
    assert list(tables["speedup_of_means"]) == ["mixed", "all_hardware"]
    json.dumps(tables, allow_nan=False)


def test_the_error_is_signed_and_relative():
    records = {"mixed": {"sort": like_the_board("mixed", "sort", factor=0.8)}}
    assert experiment_tables(records)["mappings"]["mixed"]["sort"]["median_error"] == pytest.approx(
        -0.2, abs=1e-3
    )


@pytest.mark.parametrize(
    ("error", "expected"),
    [(0.1, "good"), (-0.1, "good"), (0.11, "fair"), (-0.25, "fair"), (0.26, "bad"), (None, "")],
)
def test_an_error_of_a_median_is_good_up_to_a_tenth_and_fair_up_to_a_quarter(error, expected):
    assert grade(error) == expected


def test_only_the_error_takes_the_times_modulo_a_second():
    median = reference_cells()["mixed"]["sobel"].median_ms
    cell = experiment_tables({"mixed": {"sobel": Record("sobel", np.full(9, 2000 + median))}})
    cell = cell["mappings"]["mixed"]["sobel"]
    assert cell["median_error"] == pytest.approx(0, abs=1e-9)
    assert cell["median_ms"] == pytest.approx(2000 + median)


def test_without_a_reference_or_an_answer_the_error_is_null():
    empty = Record("sort", np.array([]), lost=3)
    tables = experiment_tables(
        {
            "all_software": {"sort": like_the_board("all_software", "sort")},
            "mine": {"sort": empty},
            "mixed": {"sort": empty},
        }
    )
    assert tables["mappings"]["mine"]["sort"]["reference_median_ms"] is None
    assert tables["mappings"]["mine"]["sort"]["median_error"] is None
    assert tables["mappings"]["mixed"]["sort"]["reference_median_ms"] is not None
    assert tables["mappings"]["mixed"]["sort"]["median_error"] is None
    assert tables["speedup_of_means"] == {"mine": {"sort": None}, "mixed": {"sort": None}}


def test_without_all_software_there_is_no_speedup(board_records):
    del board_records["all_software"]
    tables = experiment_tables(board_records)
    assert (tables["speedup_of_means"], tables["speedup_of_medians"]) == ({}, {})


def test_the_printed_table_fits_80_columns_and_is_plain(board_records):
    text = printed(experiment_of(board_records))
    assert "\x1b" not in text
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    (row,) = [line.split() for line in text.splitlines() if line.startswith("mixed") and "sort" in line]
    assert row[:6] == ["mixed", "sort", "201", "0", "0", "2.63"]
    assert row[8:] == ["2.63", "+0.0", "%", "19.65"]


def test_colours_follow_the_terminal(board_records, monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    experiment = experiment_of({"mixed": {"sort": like_the_board("mixed", "sort", factor=3)}})
    terminal = {"force_terminal": True, "color_system": "standard"}
    assert "\x1b[31m" in printed(experiment, **terminal)
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[31m" not in printed(experiment, **terminal)


def test_long_names_are_folded_not_cut():
    name = "a_mapping_with_a_name_that_is_longer_than_any_column"
    text = printed(experiment_of({name: {"sort": Record("sort", np.array([1.0, 2.0]))}}))
    assert "…" not in text
    lines = text.splitlines()
    assert "".join(line.split()[0] for line in lines[3:] if line.strip() and line[0] in name).startswith(
        "a_mapping"
    )


@pytest.mark.parametrize(("requests", "warned"), [(100, True), (999, True), (1000, False)])
def test_few_requests_are_no_verdict_on_a_median(board_records, requests, warned):
    experiment = {**experiment_of(board_records), "requests": requests}
    assert (f"of {requests}, one that lies between" in " ".join(printed(experiment).split())) is warned
