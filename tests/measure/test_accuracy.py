"""How close an experiment's medians are to the real board's, in figures and in words."""

from __future__ import annotations

import json

import pytest
from board_like_runs import like_the_board

from reconros_zenoh.measure.compare import accuracy, accuracy_sentence, experiment_tables


def cells(**errors: float | None):
    return {"mixed": {client: {"median_error": error} for client, error in errors.items()}}


def test_the_board_itself_is_accurate_in_all_15_cells(board_records):
    found = experiment_tables(board_records)["accuracy"]
    assert (found["cells"], found["within_10_percent"]) == (15, 15)
    assert found["mean_absolute_error"] == pytest.approx(0, abs=1e-3)
    json.dumps(found, allow_nan=False)


def test_errors_count_by_their_size_and_not_their_sign():
    found = accuracy(cells(sort=-0.3, sobel=0.2, mnist=-0.1, hash=0.0))
    assert found == {
        "cells": 4,
        "within_10_percent": 2,
        "worst": {"mapping": "mixed", "client": "sort", "error": -0.3},
        "mean_absolute_error": pytest.approx(0.15),
        "mean_absolute_error_without_hash": pytest.approx(0.2),
    }


def test_cells_without_a_reference_do_not_count():
    found = accuracy(cells(sort=0.04, mine=None))
    assert (found["cells"], found["mean_absolute_error"]) == (1, 0.04)


def test_without_any_reference_there_is_no_error():
    found = accuracy(cells(mine=None))
    assert (found["cells"], found["within_10_percent"]) == (0, 0)
    assert found["worst"] is None
    assert found["mean_absolute_error"] is None
    assert "none of these" in accuracy_sentence(found)


def test_a_run_of_the_hash_alone_has_no_error_without_it():
    found = accuracy(cells(hash=0.01))
    assert found["mean_absolute_error_without_hash"] is None
    assert "without hash" not in accuracy_sentence(found)


def test_the_sentence_says_it_all():
    records = {"mixed": {"sort": like_the_board("mixed", "sort", factor=1.5)}}
    sentence = accuracy_sentence(experiment_tables(records)["accuracy"])
    assert "0 of 1 medians within 10 %" in sentence
    assert "worst sort under mixed (+50.0 %)" in sentence
