"""What the round-trip experiment refuses before anything runs, and what it compares with the real board."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from reconros_zenoh.cli.experiment import plan
from reconros_zenoh.cli.options import ClockName
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.roundtrip import BoardReport, Plan, application_folder, finish
from reconros_zenoh.measure.compare import accuracy_sentence
from reconros_zenoh.measure.record import RecordWriter, RoundTrip

if TYPE_CHECKING:
    from pathlib import Path

SHIPPED = application_folder() / "mappings" / "all_hardware.toml"


def planned(
    mapping: Path, folder: Path, profile: str = "miniitx-zynq7100", clock: ClockName = ClockName.VIRTUAL
) -> Plan:
    return plan(clock, [str(mapping)], 5, 0, folder, profile)


def test_a_mapping_of_ones_own_is_not_named_like_a_measured_one(tmp_path: Path) -> None:
    mapping = tmp_path / "all_hardware.toml"
    mapping.write_text(SHIPPED.read_text(encoding="utf-8").replace("[2, 3]", "[2]"), encoding="utf-8")
    with pytest.raises(UsageError, match=r"is not the mapping 'all_hardware' that the real board ran"):
        planned(mapping, tmp_path)


def test_a_copy_of_a_measured_mapping_is_that_mapping(tmp_path: Path) -> None:
    mapping = tmp_path / "all_hardware.toml"
    mapping.write_text("# a copy\n" + SHIPPED.read_text(encoding="utf-8"), encoding="utf-8")
    assert planned(mapping, tmp_path).mappings == {"all_hardware": mapping}


@pytest.mark.parametrize(("profile", "cells"), [("native", 0), ("miniitx-zynq7100", 1)])
def test_what_models_no_board_is_not_compared_with_one(tmp_path: Path, profile: str, cells: int) -> None:
    plan = Plan("wall", {"all_hardware": SHIPPED}, 1, 0, profile, tmp_path)
    with RecordWriter(plan.record_path("all_hardware", "sort")) as writer:
        writer.write(RoundTrip(0, 2_600_000, "ok"))
    experiment = finish(plan, BoardReport(), interrupted=False)
    cell = experiment["mappings"]["all_hardware"]["sort"]
    assert cell["reference_median_ms"] is not None
    assert (cell["median_error"] is None) == (cells == 0)
    assert experiment["accuracy"]["cells"] == cells
    assert ("a profile that models a board" in accuracy_sentence(experiment["accuracy"])) == (cells == 0)


def test_of_several_boards_the_worst_figures_of_the_host_are_told() -> None:
    def status(overruns: int, lag_us: float | None, priority: bool | None) -> dict[str, Any]:
        lag = dict.fromkeys(("lag_p50_us", "lag_p99_us"), lag_us)
        return {"host": {"overruns": overruns, **lag, "real_time_priority": priority}}

    def told(*statuses: dict[str, Any]) -> list[Any]:
        host = BoardReport({str(number): each for number, each in enumerate(statuses)}).host()
        return [host[key] for key in ("overruns", "lag_p50_us", "lag_p99_us", "real_time_priority")]

    assert told() == [None, None, None, None]
    assert told(status(0, None, None)) == [0, None, None, None]
    assert told(status(1, 90.0, True), status(2, 20.0, True)) == [3, 90.0, 90.0, True]
    assert told(status(1, 20.0, True), status(2, 90.0, False)) == [3, 90.0, 90.0, False]


@pytest.mark.parametrize("clock", ClockName)
def test_a_board_that_cannot_host_the_callbacks_is_refused_in_either_clock(
    tmp_path: Path, clock: ClockName
) -> None:
    with pytest.raises(UsageError, match="profile 'zcu104' has no times for callback 'inverse'"):
        planned(SHIPPED, tmp_path, "zcu104", clock)
    assert not list(tmp_path.iterdir())
