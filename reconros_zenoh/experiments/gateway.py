"""Section 4 of the gateways paper: one topic with many subscribers, in software and with a gateway."""

from __future__ import annotations

import statistics
from dataclasses import asdict, dataclass, replace
from importlib.resources import as_file, files
from itertools import product
from typing import TYPE_CHECKING, Any, Literal, get_args

from reconros_zenoh.applications.gateway.nodes import SUBSCRIBERS, random_body, run_nodes
from reconros_zenoh.board.sources import Event, Source
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.clock.virtual import VirtualEnvironment, succeed_once
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.errors import ExperimentError, UsageError
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.provenance import host, provenance
from reconros_zenoh.experiments.simulation import check_hosting
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.mapping_file import CallbackMapping, ProjectMapping
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.experiments.roundtrip import Clock
    from reconros_zenoh.project.application import Application
    from reconros_zenoh.project.loader import Project

Variant = Literal["smt", "bridged"]
SIZES = {"10kB": 10_000, "100kB": 100_000, "1MB": 1_000_000, "10MB": 10_000_000}
COUNTS = (2, 4, 8)

_LIMIT_NS = 60_000_000_000
_PAUSE_NS = 1_000_000


@dataclass(frozen=True, slots=True)
class Times:
    """Transmission times [ms]: the largest over the subscribers in hardware, and that to software.

    Messages that were `lost` to somebody are not in them.
    """

    hw_max_ms: float
    sw_ms: float
    lost: int = 0


@dataclass(frozen=True, slots=True)
class Cell:
    """What was measured of one publisher, size [bytes] and number of hardware subscribers."""

    publisher: Side
    size: int
    subscribers: int
    smt: Times
    gateway: Times

    def as_json(self) -> dict[str, Any]:
        """Return the cell under the names of the experiment's JSON."""
        return {**asdict(self), "speedup_hw": self.speedup_hw, "speedup_sw": self.speedup_sw}

    @property
    def speedup_hw(self) -> float:
        """How many times sooner the last hardware subscriber has its copy with the gateway."""
        return self.smt.hw_max_ms / self.gateway.hw_max_ms

    @property
    def speedup_sw(self) -> float:
        """How many times sooner the software subscriber has its copy with the gateway."""
        return self.smt.sw_ms / self.gateway.sw_ms


def check_profile(profile: Profile, publishers: Iterable[Side], counts: Sequence[int]) -> None:
    """Raise UsageError for a profile without a time that one of the setups needs."""
    if profile.model is None or profile.model.topics is None:
        raise UsageError(
            f"profile {profile.name!r} does not know what topics inside a board cost. Use --profile zcu104, "
            "or native to measure this host."
        )
    for variant, publisher in product(get_args(Variant), publishers):
        check_hosting(profile, _project(variant), setup_mapping(publisher, max(counts)))


def measure_gateway(
    clock: Clock,
    profile: Profile,
    publishers: Iterable[Side],
    sizes: Iterable[int],
    counts: Sequence[int],
    repeat: int,
    on_cell: Callable[[], None],
) -> dict[str, Any]:
    """Return every cell with the means of `repeat` messages, beside what the paper's text says.

    `on_cell` is called after each. Ctrl-C keeps the cells that are complete. Raise ExperimentError when a
    subscriber got something wrong or nothing.
    """
    sizes = list(sizes)
    bodies = {size: random_body(size) for size in sizes}
    cells: list[Cell] = []
    overruns = 0
    with until_interrupted() as interruption:
        for publisher, size, count in product(publishers, sizes, counts):
            times = {}
            for variant in get_args(Variant):
                times[variant], late = _run(clock, profile, variant, publisher, count, bodies[size], repeat)
                overruns += late
            cells.append(Cell(publisher, size, count, times["smt"], times["bridged"]))
            on_cell()
    return {
        "experiment": "gateway",
        "clock": clock,
        "repeat": repeat,
        "profile": profile.name,
        "statistic": "mean",
        "cells": [cell.as_json() for cell in cells],
        "anchors": anchors(cells),
        "host": host(overruns),
        "interrupted": interruption.happened,
        **provenance(),
    }


def anchors(cells: Iterable[Cell]) -> list[dict[str, Any]]:
    """Return what the text of Section 4 says, beside the same of these cells; only what they hold.

    `error` is relative. Of the ranges the text does not say where they end: by its trends at the smallest and
    the largest of messages and numbers of subscribers.
    """
    found: dict[tuple[Side, int, int], Cell] = {
        (cell.publisher, cell.size, cell.subscribers): cell for cell in cells
    }
    small, large, few, many = SIZES["10kB"], SIZES["10MB"], COUNTS[0], COUNTS[-1]
    wanted: tuple[tuple[str, float, tuple[Side, int, int], Literal["hw", "sw"]], ...] = (
        ("hardware to hardware, 8 subscribers, 10 kB", 1.94, (Side.HARDWARE, small, many), "hw"),
        ("hardware to hardware, 8 subscribers, 10 MB", 7.95, (Side.HARDWARE, large, many), "hw"),
        ("hardware to software, smallest", 0.5, (Side.HARDWARE, small, few), "sw"),
        ("hardware to software, 8 subscribers, 10 MB", 1.0, (Side.HARDWARE, large, many), "sw"),
        ("software to hardware, largest", 3.79, (Side.SOFTWARE, large, many), "hw"),
        ("software to software, smallest", 1.06, (Side.SOFTWARE, small, few), "sw"),
        ("software to software, largest", 2.05, (Side.SOFTWARE, large, many), "sw"),
    )
    rows = []
    for name, paper, key, side in wanted:
        if key in found:
            ours = found[key].speedup_hw if side == "hw" else found[key].speedup_sw
            rows.append({"name": name, "paper": paper, "ours": ours, "error": ours / paper - 1})
    return rows


def setup_mapping(publisher: Side, count: int) -> ProjectMapping:
    """Return the mapping with this publisher and so many hardware subscribers; other nodes have no place."""
    nowhere = CallbackMapping()
    return ProjectMapping(
        name=f"{publisher} publisher, {count} hardware subscribers",
        executor="reconros",
        software_workers=2,
        hardware_workers=1 + SUBSCRIBERS,
        callbacks={
            "publisher_hardware": CallbackMapping(slots=(0,)) if publisher is Side.HARDWARE else nowhere,
            "publisher_software": CallbackMapping(software=True) if publisher is Side.SOFTWARE else nowhere,
            "software": CallbackMapping(software=True),
            **{
                f"hardware_{index}": CallbackMapping(slots=(index + 1,)) if index < count else nowhere
                for index in range(SUBSCRIBERS)
            },
        },
    )


def _project(variant: Variant) -> Project:
    with as_file(files("reconros_zenoh.applications.gateway") / variant) as folder:
        return load_project(folder)


def _run(
    clock: Clock,
    profile: Profile,
    variant: Variant,
    publisher: Side,
    count: int,
    body: NDArray[np.uint8],
    repeat: int,
) -> tuple[Times, int]:
    """Return the times of one setup, and how often this host was slower than the model."""
    environment = WallEnvironment() if clock == "wall" else VirtualEnvironment()
    rounds = _Rounds(environment, count, repeat)

    def main(app: Application) -> None:
        run_nodes(app, body, rounds, rounds.note)

    network = SimulatedNetwork(environment)
    hosted = HostedBoard(
        environment,
        network.transport("b0"),
        profile,
        replace(_project(variant), main=main),
        setup_mapping(publisher, count),
        BoardOptions(),
    )
    try:
        environment.run(until=rounds.done)
        return rounds.times(), hosted.board.host.overruns.count
    finally:
        hosted.close()


class _Rounds(Source):
    """Triggers the publisher once everybody has the message before it.

    The first message is not timed: it loads the slots.
    """

    def __init__(self, environment: VirtualEnvironment, count: int, repeat: int) -> None:
        super().__init__()
        self._environment = environment
        self._readers = count + 1
        self._last = repeat + 1
        self._number = 0
        self._got: dict[str, int] = {}
        self._hw_ns: list[int] = []
        self._sw_ns: list[int] = []
        self.done = environment.event()

    def begin(self) -> None:
        """Publish the next message."""
        self._number += 1
        self._got.clear()
        self._environment.call_later(_LIMIT_NS, self._give_up, self._number)
        self.enqueue(Event(None, Timeline(self._environment, self._environment.now)))

    def note(self, name: str, number: int, transmission_ns: int) -> None:
        """Note when a subscriber had its copy; callable from any thread."""
        self._environment.post(self._note, name, number, transmission_ns)

    def times(self) -> Times:
        """Return the means."""
        return Times(statistics.fmean(self._hw_ns) / 1e6, statistics.fmean(self._sw_ns) / 1e6)

    def _note(self, name: str, number: int, transmission_ns: int) -> None:
        if number != self._number or name in self._got:
            self._fail(f"subscriber {name} got message {number} once more.")
            return
        self._got[name] = transmission_ns
        if len(self._got) < self._readers:
            return
        if self._number > 1:
            self._sw_ns.append(self._got.pop("software"))
            self._hw_ns.append(max(self._got.values()))
        if self._number == self._last:
            succeed_once(self.done)
        else:
            self._environment.call_later(_PAUSE_NS, self.begin)

    def _give_up(self, number: int) -> None:
        if number == self._number:
            self._fail(f"message {number} reached {len(self._got)} of {self._readers} subscribers rightly.")

    def _fail(self, problem: str) -> None:
        if not self.done.triggered:
            self.done.fail(ExperimentError(problem))
