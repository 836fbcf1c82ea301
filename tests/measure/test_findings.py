from __future__ import annotations

import io

import numpy as np
import pytest
from board_like_runs import experiment_of, like_the_board
from rich.console import Console

from reconros_zenoh.cli.experiment import show
from reconros_zenoh.measure.findings import findings
from reconros_zenoh.measure.record import Record


def constant(value, n=10, lost=0, wrong=0):
    return Record("sort", np.full(n, value), lost=lost, wrong=wrong)


def by_subject(records, clock="virtual", **more):
    return {finding.subject: finding for finding in findings(experiment_of(records, clock, **more))}


def host(overruns):
    return {"overruns": overruns, "lag_p50_us": 10.0, "lag_p99_us": 90.0}


def test_the_best_mapping_is_named_with_the_worst():
    found = by_subject({"a": {"x": constant(50.0)}, "b": {"x": constant(2.5)}, "c": {"x": constant(2.6)}})
    assert (
        found["x"].sentence
        == "shortest under b and c, median 2.50 and 2.60 ms; longest under a, 50.00 ms, 20.0 times as long."
    )
    assert not found["x"].warning


def test_medians_within_the_boards_own_repeatability_are_no_difference():
    found = by_subject({"a": {"x": constant(250.0)}, "b": {"x": constant(248.0)}})
    assert found["x"].sentence == "the mapping makes no difference: medians 248.0 and 250.0 ms under b and a."


def test_one_mapping_is_told_and_not_compared():
    assert by_subject({"a": {"x": constant(2.5)}})["x"].sentence == "median 2.50 ms under a."


def test_a_mapping_without_answers_is_a_warning():
    found = by_subject(
        {
            "a": {"x": constant(2.5), "y": constant(1, n=0)},
            "b": {"x": constant(1, n=0), "y": constant(1, n=0)},
        }
    )
    assert found["x"] == ("x", "shortest under a, median 2.50 ms; no answer under b.", True)
    assert found["y"] == ("y", "no answer under any mapping.", True)


def test_the_real_board_is_counted():
    records = {
        "mixed": {
            "sort": like_the_board("mixed", "sort", 1.05),
            "inverse": like_the_board("mixed", "inverse", 1.5),
        }
    }
    found = by_subject(records)["real board"].sentence
    assert found.startswith("1 of 2 medians lie within 10 % of the real board's; the furthest off: ")
    assert found.endswith(" inverse under mixed (+50.0 %).")
    assert "real board" not in by_subject({"mine": {"sort": constant(1.0)}})


def test_losses_and_wrong_answers_are_a_warning():
    assert by_subject({"a": {"x": constant(1.0)}})["requests"] == (
        "requests",
        "all 10 were answered, and every answer was right.",
        False,
    )
    found = by_subject({"a": {"x": constant(1.0, lost=3, wrong=2)}})["requests"]
    assert found == ("requests", "10 answered, 2 of them wrongly, and 3 lost.", True)


def test_the_host_is_blamed_where_it_was_too_slow():
    records = {"a": {"x": constant(1.0)}}
    assert by_subject(records, "wall", host=host(4))["host"].sentence.startswith(
        "4 times a computation took longer"
    )
    assert by_subject(records, "wall", host=host(4))["host"].warning
    assert (
        by_subject(records, "wall", host=host(0))["host"].sentence
        == "it kept up with the modelled times: no overrun."
    )
    late = by_subject(records, "wall", host=host(0) | {"lag_p99_us": 2345.0})["host"]
    assert late.sentence.startswith("One event in a hundred of the board came more than 2.3 ms late")
    assert late.warning
    assert not by_subject(records, "virtual", host=host(4))["host"].warning


@pytest.mark.parametrize(
    ("clock", "overruns", "says"),
    [
        ("wall", 1, "host: Once a computation took longer on this computer"),
        ("wall", 3, "host: 3 times a computation took longer on this computer"),
        ("wall", 0, "host: it kept up with the modelled times: no overrun."),
        ("wall", None, "host: whether it kept up is not known"),
        ("virtual", 0, ""),
    ],
)
def test_the_terminal_says_of_wall_time_whether_the_host_kept_up(clock, overruns, says):
    stream = io.StringIO()
    kept = host(overruns) | ({"lag_p50_us": None, "lag_p99_us": None} if overruns is None else {})
    show(Console(file=stream, width=80), experiment_of({"a": {"x": constant(2.5)}}, clock, host=kept))
    said = stream.getvalue().partition("host: ")
    assert " ".join((said[1] + said[2]).split()).startswith(says)
    assert bool(said[1]) == bool(says)
