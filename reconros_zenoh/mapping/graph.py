"""The computation graph of a ROS application after its nodes were mapped to hardware and software."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

from reconros_zenoh.errors import GraphError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


class Side(StrEnum):
    """Where a node is mapped to: N_HW or N_SW."""

    HARDWARE = "hardware"
    SOFTWARE = "software"


class Edge(NamedTuple):
    """An edge of the graph: the node publishes on the topic, or subscribes to it."""

    node: str
    topic: str
    publishes: bool


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic with the names of its publishers and subscribers.

    `size` is that of a message [bytes], `rate` counts the messages of all its publishers [1/s]; None where
    they are not known.
    """

    name: str
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    size: int | None = None
    rate: float | None = None

    @property
    def edges(self) -> Iterator[Edge]:
        """The edges of this topic, E_pub^t before E_sub^t."""
        yield from (Edge(node, self.name, publishes=True) for node in self.publishers)
        yield from (Edge(node, self.name, publishes=False) for node in self.subscribers)


@dataclass(frozen=True, slots=True)
class ComputationGraph:
    """A graph G = (N u T, E_pub u E_sub) with the node mapping (Mapping and Optimizing, Section 5).

    `notes` say what whoever read the graph left out or assumed. Raise GraphError for a topic that stands
    twice, has no publisher, names an unknown node or one node twice, or has a size or rate of nothing,
    and for a name that cannot be printed.
    """

    nodes: Mapping[str, Side]
    topics: tuple[Topic, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        named = [("nodes", name) for name in self.nodes] + [("topics", topic.name) for topic in self.topics]
        for place in named:
            if not place[1].isprintable():
                raise GraphError(
                    place, "has a name that cannot be printed.", "Take the control characters away."
                )
        known: set[str] = set()
        for topic in self.topics:
            if topic.name in known:
                raise GraphError(("topics", topic.name), "stands twice.", "Give each topic once.")
            known.add(topic.name)
            self._check(topic)

    def on(self, side: Side, nodes: tuple[str, ...]) -> tuple[str, ...]:
        """Return those of the nodes that are mapped to that side."""
        return tuple(node for node in nodes if self.nodes[node] is side)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is unusual in the graph and probably a mistake."""
        return tuple(
            f"topic {topic.name} has no subscriber." for topic in self.topics if not topic.subscribers
        )

    def _check(self, topic: Topic) -> None:
        place = ("topics", topic.name)
        if not topic.publishers:
            raise GraphError(place, "has no publisher.", "Name the nodes that publish on it.")
        for end, nodes in (("publishers", topic.publishers), ("subscribers", topic.subscribers)):
            for index, node in enumerate(nodes):
                if node not in self.nodes:
                    raise GraphError(
                        (*place, end, index),
                        f"is the unknown node {node!r}.",
                        f"Known nodes: {', '.join(self.nodes) or 'none'}.",
                    )
                if node in nodes[:index]:
                    raise GraphError((*place, end, index), f"names {node!r} again.", "Name each node once.")
        if topic.size is not None and topic.size < 1:
            raise GraphError((*place, "size"), f"is {topic.size}.", "Give the bytes of a message, 1 or more.")
        if topic.rate is not None and not 0 < topic.rate < math.inf:
            raise GraphError(
                (*place, "rate"), f"is {topic.rate:g}.", "Give the messages per second, more than 0."
            )
