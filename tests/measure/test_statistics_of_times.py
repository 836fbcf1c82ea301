from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.measure.statistics import format_error, format_ms, format_part, format_speedup, summarise

NAMES = [
    "n",
    "lost",
    "wrong",
    "mean_ms",
    "p5_ms",
    "p25_ms",
    "median_ms",
    "p75_ms",
    "p95_ms",
    "p99_ms",
    "max_ms",
]


@given(st.lists(st.floats(0, 1e5), min_size=1), st.integers(0, 9), st.integers(0, 9))
def test_the_summary_agrees_with_numpy(values, lost, wrong):
    array = np.array(values)
    summary = summarise(array, lost, wrong)
    assert list(summary) == NAMES
    assert (summary["n"], summary["lost"], summary["wrong"]) == (len(values), lost, wrong)
    assert summary["mean_ms"] == pytest.approx(np.mean(array))
    assert summary["median_ms"] == pytest.approx(np.median(array))
    assert summary["max_ms"] == np.max(array)
    for p in (5, 25, 75, 95, 99):
        assert summary[f"p{p}_ms"] == np.percentile(array, p)


def test_without_answers_there_are_no_times():
    summary = summarise(np.array([]), 5, 0)
    assert list(summary) == NAMES
    assert (summary["n"], summary["lost"], summary["wrong"]) == (0, 5, 0)
    assert {summary[name] for name in NAMES[3:]} == {None}


def test_figures_are_written_for_people():
    assert [format_ms(v) for v in (None, 2.634, 99.99, 100.04)] == ["-", "2.63", "99.99", "100.0"]
    assert [format_ms(v) for v in (0.1, 0.0123, 0.0032, 1e-6, 0.0)] == [
        "0.10",
        "0.012",
        "0.0032",
        "0.000001",
        "0.00",
    ]
    assert [format_part(v) for v in (None, 0.0032, 2.634, 100.04)] == ["-", "0.00", "2.63", "100.0"]
    assert [format_error(v) for v in (None, 0.0312, -0.5)] == ["-", "+3.1 %", "-50.0 %"]
    assert [format_speedup(v) for v in (None, 19.647)] == ["-", "19.65"]
