"""Section 6 of the gateways paper: a chain of nodes that drives a robot, its topics mapped in three steps."""

from __future__ import annotations

import csv
import shutil
import statistics
import tempfile
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from host_clients.robot import RobotOptions, Step, most_off_lane_mm, stood_s
from reconros_zenoh.applications.driving.chain import STATIONS, Chain
from reconros_zenoh.applications.driving.kernels import LANE_WIDTH
from reconros_zenoh.applications.driving.main import main, run_nodes
from reconros_zenoh.errors import ExperimentError, UsageError
from reconros_zenoh.experiments.provenance import machine, provenance, writing
from reconros_zenoh.experiments.simulation import Simulation, check_hosting
from reconros_zenoh.mapping.apply import apply_mapping
from reconros_zenoh.mapping.communication import TopicMapping, map_topics
from reconros_zenoh.mapping.project_graph import read_project_graph
from reconros_zenoh.measure.record import RecordWriter, RoundTrip
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import Project, read_project

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.board.profile import Profile

VARIANTS: dict[str, frozenset[TopicMapping]] = {
    "all_software": frozenset(),
    "hardware_topics": frozenset({TopicMapping.HARDWARE}),
    "gateways": frozenset({TopicMapping.HARDWARE, TopicMapping.GATEWAY}),
}
"""The steps of Section 5, by what of the communication mapping is written into the project."""

SECTIONS = tuple(f"{here} to {there}" for here, there in pairwise(STATIONS))
"""From one node having a picture to the next one having what was made of it."""

_PAPER_MS = {"hardware_topics": (28.264, 3.21), "gateways": (20.270, 0.239)}
"""Mean and standard deviation of the chain."""

_EARLIER_SPEEDUP = 2.48
"""By hardware-mapped topics over standard ROS 2, as Section 6 quotes it of the application's first version,
whose chain has other nodes: no anchor."""

_REACTION_S = 0.5

FILES = ("chain.csv", "robot.csv", "pictures.tsv")
"""What there is of each variant, in a folder of its name."""


@dataclass(frozen=True, slots=True)
class Drive:
    """What came of one variant. By the picture's number: the chain's sections, and the way to the command.

    The first picture is in neither: it waits until all slots are loaded.
    """

    steps: list[Step]
    sections_ms: dict[int, list[float]]
    loop_ms: dict[int, float]
    unexpected: int

    @property
    def chain_ms(self) -> list[float]:
        """How long the chain took for each picture."""
        return [sum(sections) for sections in self.sections_ms.values()]


def check_profile(profile: Profile) -> None:
    """Raise UsageError for a profile without a time that one of the variants needs."""
    if profile.model is None or profile.model.topics is None:
        raise UsageError(
            f"profile {profile.name!r} does not know what topics inside a board cost. Use --profile zcu104."
        )
    for applied in VARIANTS.values():
        project = _mapped_project(applied)
        check_hosting(profile, project, project.mapping(None))


def run_variant(profile: Profile, variant: str, pictures: int) -> Drive:
    """Return the drive with so many pictures; raise ExperimentError when none came through the chain."""
    mapped = _mapped_project(VARIANTS[variant])
    with Simulation(mapped.types()) as simulation:
        chain = Chain(simulation.environment.clock_ns)
        project = replace(mapped, main=lambda app: run_nodes(app, chain.note))
        simulation.add_board(profile, project, project.mapping(None), BoardOptions())
        trips: list[RoundTrip] = []
        robot = simulation.add_robot(RobotOptions(pictures), trips.append)
        simulation.run()
    sections_ms = {
        int(name.rpartition(".")[2]): [ns / 1e6 for ns in sections]
        for name, sections in chain.sections_ns().items()
    }
    sections_ms.pop(0, None)
    loop_ms = {trip.index: trip.time_ns / 1e6 for trip in trips if trip.index and trip.time_ns is not None}
    if not loop_ms:
        raise ExperimentError(f"{variant}: no picture came through the chain in time.")
    return Drive(robot.steps, sections_ms, loop_ms, robot.unexpected)


def summary(
    profile: Profile, pictures: int, drives: Mapping[str, Drive], *, interrupted: bool
) -> dict[str, Any]:
    """Return the experiment's object."""
    means_ms = {name: statistics.fmean(drive.chain_ms) for name, drive in drives.items()}
    return {
        "experiment": "driving",
        "clock": "virtual",
        "profile": profile.name,
        "pictures": pictures,
        "variants": {name: _variant(name, drive) for name, drive in drives.items()},
        "anchors": anchors(means_ms),
        "speedup_of_all": {
            "paper_earlier_application": _EARLIER_SPEEDUP,
            "ours": means_ms["all_software"] / means_ms["gateways"]
            if len(means_ms) == len(VARIANTS)
            else None,
        },
        "interrupted": interrupted,
        **provenance(),
        "machine": machine(),
    }


def anchors(means_ms: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return what the paper measured of the chain beside these means, as far as they are there.

    `error` is relative. Of the model one constant is fitted to them: the bandwidth of the MEMIF, to the
    difference of the two chains.
    """
    rows = {
        f"chain, {name} [ms]": (paper_ms, means_ms[name])
        for name, (paper_ms, _) in _PAPER_MS.items()
        if name in means_ms
    }
    if len(rows) == len(_PAPER_MS):
        slow, fast = rows.values()
        rows["speedup by the gateway"] = (slow[0] / fast[0], slow[1] / fast[1])
    return [
        {"name": name, "paper": paper, "ours": ours, "error": ours / paper - 1}
        for name, (paper, ours) in rows.items()
    ]


def troubles(experiment: Mapping[str, Any]) -> list[str]:
    """Return in sentences what was not as it should be, nothing when all was."""
    found = []
    for name, variant in experiment["variants"].items():
        wanted = experiment["pictures"] - 1
        if variant["answered"] < wanted:
            found.append(f"{name}: {wanted - variant['answered']} of {wanted} pictures had no command.")
        if variant["unexpected"]:
            found.append(f"{name}: {variant['unexpected']} commands came for no picture.")
        if variant["most_off_lane_mm"] > LANE_WIDTH / 2 * 1e3:
            found.append(f"{name}: the robot left its lane.")
        if not variant["stood_at_red_s"]:
            found.append(f"{name}: the robot did not stop at the red light.")
        if variant["stood_else_s"] > _REACTION_S:
            found.append(f"{name}: the robot stood for {variant['stood_else_s']:g} s without a red light.")
    return found


def write_records(folder: Path, drives: Mapping[str, Drive]) -> None:
    """Write the FILES of each variant: records of the chain and of the loop, and a row for each picture."""
    for name, drive in drives.items():
        with writing(folder / name):
            chain, robot, table = (folder / name / file for file in FILES)
            _write_record(chain, len(drive.steps), {n: sum(ms) for n, ms in drive.sections_ms.items()})
            _write_record(robot, len(drive.steps), drive.loop_ms)
            with table.open("w", newline="", encoding="utf-8") as file:
                rows = csv.writer(file, "excel-tab")
                rows.writerow(("picture", *Step._fields, "loop_ms", *SECTIONS))
                for number, step in enumerate(drive.steps):
                    sections = drive.sections_ms.get(number, [""] * len(SECTIONS))
                    rows.writerow((number, *step, drive.loop_ms.get(number, ""), *sections))


def _write_record(path: Path, pictures: int, times_ms: Mapping[int, float]) -> None:
    with RecordWriter(path) as record:
        for number in range(1, pictures):
            time_ms = times_ms.get(number)
            record.write(
                RoundTrip(number, None, "lost")
                if time_ms is None
                else RoundTrip(number, round(time_ms * 1e6), "ok")
            )


def _variant(name: str, drive: Drive) -> dict[str, Any]:
    sections = zip(*drive.sections_ms.values(), strict=True)
    paper_mean_ms, paper_sd_ms = _PAPER_MS.get(name, (None, None))
    return {
        "answered": len(drive.loop_ms),
        "unexpected": drive.unexpected,
        "chain_mean_ms": statistics.fmean(drive.chain_ms),
        "chain_sd_ms": statistics.pstdev(drive.chain_ms),
        "paper_mean_ms": paper_mean_ms,
        "paper_sd_ms": paper_sd_ms,
        "sections_ms": dict(zip(SECTIONS, map(statistics.fmean, sections), strict=True)),
        "loop_median_ms": statistics.median(drive.loop_ms.values()),
        "most_off_lane_mm": most_off_lane_mm(drive.steps),
        "stood_at_red_s": stood_s(drive.steps, red=True),
        "stood_else_s": stood_s(drive.steps, red=False),
    }


def _mapped_project(applied: frozenset[TopicMapping]) -> Project:
    """Return the driving example with these of its topics mapped as `reconros map --apply` writes it."""
    with (
        as_file(files("reconros_zenoh.applications.driving")) as shipped,
        tempfile.TemporaryDirectory() as folder,
    ):
        copy = Path(folder) / "driving"
        shutil.copytree(shipped, copy)
        project = read_project(copy)
        mapping = project.mapping(None)
        decisions = map_topics(read_project_graph(project.configuration, mapping))
        apply_mapping(
            project.configuration,
            mapping,
            {
                topic: decision.mapping if decision.mapping in applied else TopicMapping.SOFTWARE
                for topic, decision in decisions.items()
            },
        )
        mapped = read_project(copy)
        return Project(mapped.folder, mapped.configuration, mapped.interfaces, main)
