"""Runs without one mechanism of the board model at a time."""

from __future__ import annotations

import pytest

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.experiments.ablation import COMPLETE, MECHANISMS, ablate, runs_of_ablation
from reconros_zenoh.experiments.profile_file import varied
from reconros_zenoh.experiments.roundtrip import application_folder

PROFILE = read_profile("miniitx-zynq7100")


@pytest.mark.parametrize("off", [name for name in MECHANISMS if name != COMPLETE])
def test_each_mechanism_of_the_shipped_profile_can_be_switched_off(off: str) -> None:
    without = varied(PROFILE, MECHANISMS[off])
    assert without != PROFILE
    assert varied(without, MECHANISMS[off]) == without


def test_each_mechanism_has_its_accuracy_beside_the_complete_boards() -> None:
    mappings = {"mixed": application_folder() / "mappings" / "mixed.toml"}
    done: list[None] = []
    found = ablate(PROFILE, mappings, 5, lambda: done.append(None))
    assert len(done) == runs_of_ablation(mappings)
    assert [variant["off"] for variant in found["variants"]] == list(MECHANISMS)
    assert all(variant["accuracy"]["cells"] == 5 for variant in found["variants"])
    complete, *others = [variant["accuracy"] for variant in found["variants"]]
    assert sum(variant != complete for variant in others) >= 3
    (link,) = [v["accuracy"] for v in found["variants"] if v["off"].startswith("link")]
    assert link["mean_absolute_error"] != complete["mean_absolute_error"]
