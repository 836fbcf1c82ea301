"""The design example (ReconROS Executor, Section IV): what is run, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reconros_zenoh.experiments.provenance import machine, provenance, write_experiment, writing
from reconros_zenoh.measure.record import read_record
from reconros_zenoh.measure.statistics import summarise

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.experiments.roundtrip import Clock

VARIANTS = ("one_slot", "two_slots")
"""Mappings of the project `vision`, the one of the paper first."""

RATE_HZ = 5.0
"""Pictures per second. The communication stack of the measured board is busy with one for some 80 ms."""

REPORT = "report.html"
FILES = ("filter.csv", "control.csv", "first.png", "last.png", "filtered.gif")
_PERCENTILES = {"median": 50.0, "p95": 95.0}


def projects_folder() -> Path:
    """Return the folder that holds the projects `vision` and `control`."""
    return Path(str(files("reconros_zenoh.applications.design_example")))


@dataclass(frozen=True, slots=True)
class DesignPlan:
    """One run of the experiment, all but the mapping alike for each variant."""

    clock: Clock
    seconds: float
    seed: int
    profile: str
    out: Path

    @property
    def pictures(self) -> int:
        """How many pictures the camera takes."""
        return max(1, round(self.seconds * RATE_HZ))

    @property
    def folder(self) -> Path:
        """Where this clock's records, pictures and experiment.json go."""
        return self.out / self.clock

    def variant_folder(self, variant: str) -> Path:
        """Where the records and pictures of a variant go."""
        return self.folder / variant


@dataclass(frozen=True, slots=True)
class Ending:
    """What there was when a variant ended or was interrupted."""

    status: Mapping[str, Any]
    """What the board `vision` said of itself (`board.status`)."""

    pictures: int | None
    """How many pictures the camera had taken; None where nobody counted them."""


def prepare(plan: DesignPlan) -> None:
    """Make the folders of the run, without what an earlier run left; raise UsageError if that fails."""
    with writing(plan.folder):
        for variant in VARIANTS:
            plan.variant_folder(variant).mkdir(parents=True, exist_ok=True)
            for name in FILES:
                (plan.variant_folder(variant) / name).unlink(missing_ok=True)
        for name in ("experiment.json", REPORT):
            (plan.folder / name).unlink(missing_ok=True)


def finish(plan: DesignPlan, endings: Mapping[str, Ending], *, interrupted: bool) -> dict[str, Any]:
    """Return the experiment's object, made from the records, and write it as experiment.json.

    It has the variants in `endings` of which anything was recorded; what the shared slot costs is None unless
    both were.
    """
    variants = {
        name: variant
        for name, ending in endings.items()
        if (variant := _variant(plan, name, ending))["frames_out"]
        or variant["control_out"]
        or not interrupted
    }
    experiment = {
        "experiment": "design",
        "clock": plan.clock,
        "seconds": plan.seconds,
        "seed": plan.seed,
        "profile": plan.profile,
        "variants": variants,
        "shared_slot_costs_ms": {
            chain: _difference(
                [variants[name][f"{chain}_ms"]["median"] for name in VARIANTS if name in variants]
            )
            for chain in ("filter", "control")
        },
        "interrupted": interrupted,
        **provenance(),
        "machine": machine(),
    }
    write_experiment(plan.folder, experiment)
    return experiment


def all_right(experiment: Mapping[str, Any]) -> bool:
    """Tell whether both chains gave something under each variant to its end, and nothing wrong.

    Pictures may be lost: they are sent with best effort.
    """
    return not experiment["interrupted"] and all(
        variant["frames_out"] and variant["control_out"] and not variant["wrong"]
        for variant in experiment["variants"].values()
    )


def _variant(plan: DesignPlan, variant: str, ending: Ending) -> dict[str, Any]:
    status = ending.status
    summaries = {}
    for chain in ("filter", "control"):
        record = read_record(plan.variant_folder(variant) / f"{chain}.csv")
        summaries[chain] = summarise(record.values_ms, record.lost, record.wrong, _PERCENTILES)
    slots = status["slots"]
    return {
        "reconfigurations": sum(slot["reconfigurations"] for slot in slots),
        "reconfiguration_ms": sum(slot["reconfiguration_ms"] for slot in slots),
        "slots": slots,
        "frames_in": ending.pictures,
        "frames_out": summaries["filter"]["n"],
        "control_out": summaries["control"]["n"],
        "wrong": sum(int(summary["wrong"] or 0) for summary in summaries.values()),
        **{
            f"{chain}_ms": {name: summary[name] for name in _PERCENTILES}
            for chain, summary in summaries.items()
        },
        "spans_ms": status["spans_ms"],
        "callbacks": status["callbacks"],
        "host": status["host"],
    }


def _difference(medians_ms: list[float | None]) -> float | None:
    """Return by how much the first is longer; None unless there are two."""
    known = [median_ms for median_ms in medians_ms if median_ms is not None]
    return known[0] - known[1] if len(known) == len(VARIANTS) else None
