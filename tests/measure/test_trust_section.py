"""The page of the report that says how far to trust the figures."""

from __future__ import annotations

import re

import numpy as np
import pytest
from board_like_runs import experiment_of, like_the_board

from reconros_zenoh.measure.record import Record
from reconros_zenoh.measure.report import write_report
from reconros_zenoh.measure.trust import bootstrap, trust_section


def variant(off, error, within):
    worst = {"mapping": "mixed", "client": "<sort>", "error": -0.5}
    return {
        "off": off,
        "accuracy": {
            "cells": 15,
            "within_10_percent": within,
            "worst": worst,
            "mean_absolute_error": error,
            "mean_absolute_error_without_hash": error,
        },
    }


ABLATION = {
    "requests": 200,
    "seeds": [0, 1],
    "variants": [variant("nothing", 0.03, 15), variant("NACK", 0.06, 9)],
}


def rows_of(html):
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html)]


def test_the_interval_of_a_median_has_its_known_width():
    """Order statistics: about 1.96 sqrt(n) / 2 ranks on either side."""
    median, mean, p99 = bootstrap(np.arange(1.0, 1001.0))
    assert median.value == mean.value == 500.5
    assert median.low == pytest.approx(500.5 - 31, abs=6)
    assert median.high == pytest.approx(500.5 + 31, abs=6)
    assert mean.low < 500.5 < mean.high
    assert p99.value == pytest.approx(990, abs=1)


def test_values_that_are_all_alike_have_no_width():
    assert bootstrap(np.full(50, 7.0)).mean == (7, 7, 7)


def test_cells_stand_with_intervals_and_means_are_doubted(tmp_path, board_records):
    run = experiment_of(board_records)
    write_report(tmp_path / "r.html", [run], [board_records], ABLATION)
    html = (tmp_path / "r.html").read_text(encoding="utf-8")
    section = html[html.index("How far to trust this") : html.index("The real board's data")]
    assert "15 of 15 medians within 10 %" in section
    assert "The real means only roughly" in section
    (medians,) = [row for row in rows_of(section) if row[:2] == ["sort", "mixed"] and len(row) == 5]
    assert medians[2].startswith("2.63 (")
    assert medians[3].startswith("2.63 (")
    assert medians[4] == "+0.0 %"
    assert sum(len(row) == 6 for row in rows_of(section)) == 15
    assert "200 requests per client and 2 seeds" in section


def test_each_mechanism_says_what_it_costs(board_records):
    html = "".join(trust_section([experiment_of(board_records)], [board_records], ABLATION))
    (complete,) = [row for row in rows_of(html) if row and row[0] == "nothing"]
    (without,) = [row for row in rows_of(html) if row and row[0] == "NACK"]
    assert (complete[2], complete[3], complete[5]) == ("3.0 %", "+0.0 %", "15 of 15")
    assert (without[2], without[3], without[5]) == ("6.0 %", "+3.0 %", "9 of 15")
    widths = [float(re.findall(r"width:([\d.]+)em", row[1])[0]) for row in (complete, without)]
    assert widths[0] == pytest.approx(widths[1] / 2)
    assert "&lt;sort&gt;" in html


def test_it_is_about_the_run_in_virtual_time(board_records):
    slow = {"mixed": {"sort": like_the_board("mixed", "sort", factor=3)}}
    runs = [experiment_of(slow, "wall"), experiment_of(board_records, "virtual")]
    html = "".join(trust_section(runs, [slow, board_records], None))
    assert "The run in virtual time: 15 of 15" in html
    assert "What each mechanism" not in html


def test_without_a_reference_there_is_no_such_page():
    records = {"mine": {"x": Record("x", np.array([1.0, 2.0]))}}
    assert trust_section([experiment_of(records)], [records], None) == []
    assert trust_section([], [], None) == []
