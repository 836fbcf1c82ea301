from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from reconros_zenoh.measure.histogram import NamedRecord, bin_edges, count, describe, print_histogram
from reconros_zenoh.measure.record import Record

samples = st.lists(st.floats(0, 1e6), max_size=60).map(lambda values: np.array(values, dtype=float))


def entry(values, name="mixed/sort", lost=0):
    return NamedRecord(
        name, Path("/r") / f"{name}.csv", Record("sort", np.array(values, dtype=float), lost=lost)
    )


def shown(*args, encoding=None, width=60):
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding=encoding or "utf-8")
    print_histogram(Console(file=stream, width=width), *args)
    stream.flush()
    return [line.rstrip() for line in raw.getvalue().decode().split("\n")]


VALUES = [1.0] * 8 + [2.5] * 4 + [3.5] * 2 + [4.0] * 2
TWICE = [2 * value for value in VALUES]


def test_golden_histogram():
    assert shown(entry(VALUES), None, 3) == [
        "mixed/sort",
        "from ms                                                share",
        "    1.0  ███████████████████████████████████████████  50.0 %",
        "    2.0  █████████████████████▌                       25.0 %",
        "   mean  ╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌   2.06",
        "    3.0  █████████████████████▌                       25.0 %",
        " n lost wrong mean  p50  p90  p99 p99.9  max",
        "16    0     0 2.06 1.75 3.75 4.00  4.00 4.00",
        "",
        "",
    ]


def test_golden_histogram_in_ascii():
    assert shown(entry(VALUES), None, 3, encoding="ascii")[1:6] == [
        "from ms                                                share",
        "    1.0  ###########################################  50.0 %",
        "    2.0  ######################                       25.0 %",
        "   mean  -------------------------------------------   2.06",
        "    3.0  ######################                       25.0 %",
    ]


def test_golden_comparison():
    assert shown(entry(VALUES), entry(TWICE, "all_hardware/sort"), 2, width=70) == [
        "mixed/sort | all_hardware/sort",
        "from ms                          share                          share",
        "    1.0  █████████████████████ 100.0 %  ██████████▌            50.0 %",
        "   mean  ╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌   2.06   ╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌╌   4.12",
        "    4.5                          0.0 %  ██████████▌            50.0 %",
        "times in ms        n lost wrong mean  p50  p90  p99 p99.9  max",
        "mixed/sort        16    0     0 2.06 1.75 3.75 4.00  4.00 4.00",
        "all_hardware/sort 16    0     0 4.12 3.50 7.50 8.00  8.00 8.00",
        "median ratio 0.500",
        "",
        "",
    ]


@given(samples, samples, st.integers(1, 40))
def test_no_value_is_lost_between_bins_and_outside(ours, theirs, bins):
    edges = bin_edges([ours, theirs], bins)
    for values in (ours, theirs):
        histogram = count(values, edges)
        if edges.size:
            assert histogram.counts.sum() + histogram.below + histogram.above == values.size
    if edges.size:
        assert edges.shape == (bins + 1,)
        assert np.all(np.diff(edges) > 0)
    else:
        assert not ours.size
        assert not theirs.size


@given(samples, st.integers(1, 40), st.sampled_from(["utf-8", "ascii"]), st.integers(30, 120))
def test_any_record_can_be_shown(values, bins, encoding, width):
    lines = shown(entry(values), entry(values * 2, "b/sort"), bins, encoding=encoding, width=width)
    assert max(map(len, lines)) <= max(width, 40)


def test_the_mean_outside_and_the_values_outside_are_told():
    values = [1.0] * 50 + [2.0] * 49 + [1000.0]
    text = "\n".join(shown(entry(values), None, 4, width=80))
    assert "outside the bins 0 below 1.00 ms and 1 above 2.00 ms" in text
    assert "the mean, 11.48 ms, lies outside the bins" in text


@pytest.mark.parametrize("values", [[1.0, 2.0], [1.0, 2.0, 300.0], [*range(38), 1000.0]])
def test_of_few_values_none_is_outside(values):
    histogram = count(np.array(values), bin_edges([np.array(values)], 20))
    assert (histogram.counts.sum(), histogram.below, histogram.above) == (len(values), 0, 0)


def test_a_client_without_answers_says_so():
    text = "\n".join(shown(entry([], lost=7), None, 4))
    assert "no answer" in text
    assert "█" not in text


def test_a_client_with_answers_is_shown_beside_one_without():
    text = "\n".join(shown(entry([3.0]), entry([], "b/sort", lost=7), 1, width=80))
    assert "100.0 %" in text
    assert "b/sort: no answer" in text
    assert "median ratio -" in text
    described = describe(entry([3.0]), entry([], "b/sort", lost=7), 1)
    assert (described["counts"], described["compare"]["counts"]) == ([1], [0])
    assert described["compare"]["median_ratio"] is None


def test_bins_lie_around_values_that_are_all_alike_and_between_others_however_close():
    assert bin_edges([np.array([3.0, 3.0])], 2).tolist() == [2.5, 3.0, 3.5]
    assert bin_edges([np.array([3.1, 3.3])], 2).tolist() == pytest.approx([3.1, 3.2, 3.3])


def test_the_description_agrees_with_numpy():
    ours, theirs = np.linspace(1, 5, 101), np.linspace(2, 6, 101)
    described = describe(entry(ours), entry(theirs, "b/sort", lost=2), 10)
    names = [
        "name",
        "path",
        "n",
        "lost",
        "wrong",
        "mean_ms",
        "p50_ms",
        "p90_ms",
        "p99_ms",
        "p999_ms",
        "max_ms",
        "bins_ms",
        "counts",
        "below",
        "above",
    ]
    assert list(described) == [*names, "compare"]
    assert list(described["compare"]) == [*names, "median_ratio"]
    assert described["p999_ms"] == np.percentile(ours, 99.9)
    assert described["bins_ms"] == described["compare"]["bins_ms"]
    assert sum(described["counts"]) + described["below"] + described["above"] == 101
    assert described["compare"]["median_ratio"] == pytest.approx(3 / 4)
    assert described["compare"]["lost"] == 2
    json.dumps(described, allow_nan=False)


def test_the_description_of_nothing_is_null():
    described = describe(entry([], lost=1), None, 10)
    assert (described["mean_ms"], described["max_ms"], described["compare"]) == (None, None, None)
    assert (described["bins_ms"], described["counts"]) == ([], [])
