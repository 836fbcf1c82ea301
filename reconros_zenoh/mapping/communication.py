"""The communication mapping: T_SW, T_HW and T_GW, and the edges that cross the boundary."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from reconros_zenoh.mapping.graph import Side

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.mapping.graph import ComputationGraph, Edge, Topic


class TopicMapping(StrEnum):
    """How a topic is realised: in T_SW as an SMT, in T_HW as an HMT, in T_GW as both with a gateway."""

    SOFTWARE = "software"
    HARDWARE = "hardware"
    GATEWAY = "gateway"


@dataclass(frozen=True, slots=True)
class Decision:
    """How a topic is to be realised, and why in a sentence."""

    mapping: TopicMapping
    reason: str


def map_topics(graph: ComputationGraph) -> dict[str, Decision]:
    """Return the decision for each topic by the three cases of Mapping and Optimizing, Section 5.

    Where all ends are on one side the topic is on that side, too. Of the others those with more than one
    subscriber in hardware get a gateway. A condition on all subscribers holds where there are none.
    """
    return {topic.name: _decide(graph, topic) for topic in graph.topics}


def _decide(graph: ComputationGraph, topic: Topic) -> Decision:
    sides = {graph.nodes[edge.node] for edge in topic.edges}
    if sides == {Side.SOFTWARE}:
        return Decision(TopicMapping.SOFTWARE, "All ends are in software.")
    if sides == {Side.HARDWARE}:
        return Decision(TopicMapping.HARDWARE, "All ends are in hardware.")
    readers = len(graph.on(Side.HARDWARE, topic.subscribers))
    if readers > 1:
        return Decision(
            TopicMapping.GATEWAY,
            f"Ends on both sides and {readers} subscribers in hardware: "
            "a gateway transfers each message once for all of them.",
        )
    return Decision(
        TopicMapping.SOFTWARE,
        f"Ends on both sides, but {'one subscriber' if readers else 'no subscriber'} in hardware: "
        "the method gives a gateway to more than one, whatever publishes.",
    )


def topics_of(mappings: Mapping[str, TopicMapping], wanted: TopicMapping) -> list[str]:
    """Return the names of the topics of that mapping, sorted."""
    return sorted(name for name, mapping in mappings.items() if mapping is wanted)


def crossing_edges(graph: ComputationGraph, mappings: Mapping[str, TopicMapping]) -> list[Edge]:
    """Return the edges between a node and a topic on different sides, in the order of the graph.

    An SMT is in software. An HMT is in hardware, and so is a topic with a gateway: of its edges those to
    nodes in software cross, as in Mapping and Optimizing, Fig. 8(d).
    """
    return [
        edge
        for topic in graph.topics
        for edge in topic.edges
        if (graph.nodes[edge.node] is Side.SOFTWARE) is not (mappings[topic.name] is TopicMapping.SOFTWARE)
    ]


@dataclass(frozen=True, slots=True)
class Crossings:
    """The edges over the boundary with every topic in software, with T_HW in hardware, and with gateways."""

    all_software: list[Edge]
    hardware_topics: list[Edge]
    gateways: list[Edge]

    @classmethod
    def of(cls, graph: ComputationGraph, mappings: Mapping[str, TopicMapping]) -> Crossings:
        """Return the edges in these three steps towards a communication mapping."""
        without_gateways = {
            name: TopicMapping.SOFTWARE if mapping is TopicMapping.GATEWAY else mapping
            for name, mapping in mappings.items()
        }
        return cls(
            crossing_edges(graph, dict.fromkeys(mappings, TopicMapping.SOFTWARE)),
            crossing_edges(graph, without_gateways),
            crossing_edges(graph, mappings),
        )
