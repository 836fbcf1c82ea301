"""The round-trip experiment (ReconROS Executor, Section V-C): what is run, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.experiments.provenance import host, provenance, write_experiment, writing
from reconros_zenoh.measure.compare import experiment_tables
from reconros_zenoh.measure.record import read_record
from reconros_zenoh.project.loader import load_project

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.measure.record import Record
    from reconros_zenoh.project.loader import Project

Client = Literal["inverse", "mnist", "sobel", "sort", "hash"]
CLIENTS: tuple[str, ...] = get_args(Client)
"""In the order in which the paper's Fig. 6 shows them."""

ANSWER_LIMIT_S = 10.0
"""Longer than the clients' own limit: the modelled stack can take 3 s to repair a large message."""

Clock = Literal["wall", "virtual"]


def application_folder() -> Path:
    """Return the folder of the project that the experiment runs."""
    return Path(str(files("reconros_zenoh.applications.roundtrip")))


@cache
def application() -> Project:
    """Return the project that the experiment runs, read once."""
    return load_project(application_folder())


@dataclass(frozen=True, slots=True)
class Plan:
    """One run of the experiment: the mapping files by name, all else alike for each of them."""

    clock: Clock
    mappings: Mapping[str, Path]
    requests: int
    seed: int
    profile: str
    out: Path

    @property
    def folder(self) -> Path:
        """Where this clock's records and experiment.json go."""
        return self.out / self.clock

    @property
    def drawing(self) -> Path:
        """Where the drawing of all its records goes."""
        return self.folder / "roundtrips.png"

    def record_path(self, mapping: str, client: str) -> Path:
        """Where the round trips of one client go."""
        return self.folder / mapping / f"{client}.csv"


@dataclass(slots=True)
class BoardReport:
    """What the boards said of themselves (`board.status`) at the end or interruption, by mapping."""

    statuses: dict[str, Mapping[str, Any]] = field(default_factory=dict)

    def host(self) -> dict[str, Any]:
        """Return the overruns of all mappings together, else the worst, None where no board told it."""
        hosts = [status["host"] for status in self.statuses.values()]
        worst = {"lag_p50_us": max, "lag_p99_us": max, "real_time_priority": min}
        return {
            **host(sum(each["overruns"] for each in hosts) if hosts else None),
            **{
                key: of((each[key] for each in hosts if each[key] is not None), default=None)
                for key, of in worst.items()
            },
        }


def finish(plan: Plan, report: BoardReport, *, interrupted: bool) -> dict[str, Any]:
    """Return the experiment's object, made from the records, and write it as experiment.json."""
    experiment = {
        "experiment": "roundtrip",
        "clock": plan.clock,
        "requests": plan.requests,
        "seed": plan.seed,
        **experiment_tables(_records(plan), modelled=read_profile(plan.profile).model is not None),
        "host": report.host(),
        "spans": {mapping: status["spans_ms"] for mapping, status in report.statuses.items()},
        "timing": {
            mapping: {name: callback["timing"] for name, callback in status["callbacks"].items()}
            for mapping, status in report.statuses.items()
        },
        "rejected": {mapping: status["rejected"] for mapping, status in report.statuses.items()},
        "interrupted": interrupted,
        "profile": plan.profile,
        **provenance(),
    }
    write_experiment(plan.folder, experiment)
    return experiment


def all_right(experiment: Mapping[str, Any]) -> bool:
    """Tell whether every request was made, answered and answered rightly."""
    return not experiment["interrupted"] and all(
        cell["n"] == experiment["requests"] and not cell["lost"] and not cell["wrong"]
        for clients in experiment["mappings"].values()
        for cell in clients.values()
    )


def prepare(plan: Plan) -> None:
    """Make the folders of the run, without what an earlier run left; raise UsageError if that fails."""
    with writing(plan.folder):
        for mapping in plan.mappings:
            (plan.folder / mapping).mkdir(parents=True, exist_ok=True)
            for client in CLIENTS:
                plan.record_path(mapping, client).unlink(missing_ok=True)
        for path in (plan.folder / "experiment.json", plan.drawing):
            path.unlink(missing_ok=True)


def _records(plan: Plan) -> dict[str, dict[str, Record]]:
    return {
        mapping: {
            client: read_record(path)
            for client in CLIENTS
            if (path := plan.record_path(mapping, client)).exists()
        }
        for mapping in plan.mappings
        if any(plan.record_path(mapping, client).exists() for client in CLIENTS)
    }
