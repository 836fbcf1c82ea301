"""A project under several mappings, with the same to do: what leaves its board how late."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from reconros_zenoh.board.status import status
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.experiments.stimulus import feed
from reconros_zenoh.mapping.project_graph import OUTSIDE, read_project_graph, topic_ends
from reconros_zenoh.measure.record import RecordWriter, RoundTrip
from reconros_zenoh.measure.statistics import summarise

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.experiments.stimulus import Stimulus
    from reconros_zenoh.project.build_cfg import BuildConfiguration
    from reconros_zenoh.project.hosting import BoardOptions
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import ProjectMapping

_FIGURES = {"median_ms": 50.0, "p95_ms": 95.0, "p99_ms": 99.0, "max_ms": 100.0}


@dataclass(frozen=True, slots=True)
class MappingRun:
    """What one mapping made of it: the ages [ns] of what left on each topic, and the status at the end.

    An age is the time from the message or timer that a message follows from until it is over the link.
    """

    ages_ns: Mapping[str, list[int]]
    status: Mapping[str, Any]

    def as_json(self) -> dict[str, Any]:
        """Return the figures; `busiest` is what was busy for the largest share of the time."""
        callbacks, slots = self.status["callbacks"].values(), self.status["slots"]
        published = self.status["publishers"]
        elapsed_ms = self.status["elapsed_ms"]
        busy = {f"slot {slot['id']}": slot["busy_ms"] / elapsed_ms for slot in slots}
        shares = self.status["use"] | busy
        busiest = max(shares, key=lambda name: shares[name])
        return {
            "outputs": {
                topic: _output(
                    published[topic]["sent"] if topic in published else 0, elapsed_ms / 1e3, ages_ns
                )
                for topic, ages_ns in self.ages_ns.items()
            },
            "dropped": sum(
                each["dropped"] for each in (*callbacks, *published.values(), *self.status["gateways"])
            ),
            "refused": sum(self.status["rejected"].values()),
            "failed": sum(callback["failed"] for callback in callbacks),
            "reconfigurations": sum(slot["reconfigurations"] for slot in slots),
            "busiest": {"what": busiest, "share": shares[busiest]},
            "status": self.status,
        }

    def write_records(self, folder: Path) -> None:
        """Write a record of ages for each topic, `folder/<topic>.csv`, with dots for slashes."""
        for topic, ages_ns in self.ages_ns.items():
            with RecordWriter(folder / f"{topic.strip('/').replace('/', '.')}.csv") as writer:
                for index, age_ns in enumerate(ages_ns):
                    writer.write(RoundTrip(index, age_ns, "ok"))


def outside_topics(
    configuration: BuildConfiguration, mapping: ProjectMapping, kind: Literal["rossub", "rospub"]
) -> dict[str, str]:
    """Return the topics, with their types, that a project has with the outside.

    `kind` is "rossub" for those that it hears, and "rospub" for those that it publishes.
    """
    elsewhere = OUTSIDE["rospub" if kind == "rossub" else "rossub"]
    names = {
        topic.name
        for topic in read_project_graph(configuration, mapping).topics
        if elsewhere in (*topic.publishers, *topic.subscribers)
    }
    return {
        end.topic: str(end.resource.interface)
        for end in topic_ends(configuration, mapping)
        if end.resource.type == kind and end.topic in names
    }


def run_mapping(
    profile: Profile,
    project: Project,
    mapping: ProjectMapping,
    stimulus: Stimulus,
    outputs: Mapping[str, str],
    seconds: float,
    options: BoardOptions,
) -> MappingRun:
    """Return what the project has made of the stimulus in so many seconds of virtual time.

    `outputs` names the type of each topic that is listened to. Ages are those of its last 10,000 messages.
    Raise UsageError when the board cannot host the project.
    """
    types = project.types()
    with Simulation(types) as simulation, closing(stimulus.schedule()) as schedule:
        hosted = simulation.add_board(profile, project, mapping, options)
        desktop = simulation.context().node("desktop")
        for topic, name in outputs.items():
            desktop.subscription(types.message(name), topic, lambda _: None)
        publishers = {
            topic: desktop.publisher(types.message(name), topic) for topic, name in stimulus.types.items()
        }
        environment = simulation.environment
        environment.process(feed(environment, publishers, schedule))
        environment.run(until=round(seconds * 1e9))
        ages_ns: dict[str, list[int]] = {topic: [] for topic in outputs}
        for writer in hosted.board.writers:
            if writer.topic in ages_ns:
                ages_ns[writer.topic] += writer.ages_ns
        return MappingRun(ages_ns, status(hosted.board, hosted.executor))


def _output(sent: int, seconds: float, ages_ns: list[int]) -> dict[str, Any]:
    figures = summarise(np.array(ages_ns, np.float64) / 1e6, 0, 0, _FIGURES)
    ages = {name: figures[name] for name in ("mean_ms", *_FIGURES)}
    return {"sent": sent, "rate_hz": sent / seconds, **ages}
