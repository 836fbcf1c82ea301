"""The cases of Mapping and Optimizing, Section 5, and the edges over the boundary."""

from __future__ import annotations

import pytest
from hypothesis import given
from mapped_graphs import EXAMPLE, graphs

from reconros_zenoh.mapping.communication import (
    Crossings,
    TopicMapping,
    crossing_edges,
    map_topics,
    topics_of,
)
from reconros_zenoh.mapping.graph import ComputationGraph, Edge, Side, Topic
from reconros_zenoh.mapping.graph_file import read_graph_file

HW, SW = Side.HARDWARE, Side.SOFTWARE


def mappings_of(graph: ComputationGraph) -> dict[str, TopicMapping]:
    return {name: decision.mapping for name, decision in map_topics(graph).items()}


def test_the_example_of_the_paper() -> None:
    """Fig. 8 is lost: the shipped graph is reconstructed from the text, whose every number it has to meet."""
    graph = read_graph_file(EXAMPLE)
    assert [name for name, side in graph.nodes.items() if side is SW] == ["n6", "n8", "n9"]
    assert len(graph.nodes) == 11
    mappings = mappings_of(graph)
    assert topics_of(mappings, TopicMapping.SOFTWARE) == ["D"]
    assert topics_of(mappings, TopicMapping.HARDWARE) == ["B"]
    assert topics_of(mappings, TopicMapping.GATEWAY) == ["A", "C", "E"]
    crossings = Crossings.of(graph, mappings)
    counts = [
        (len(edges), sum(edge.publishes for edge in edges))
        for edges in (crossings.all_software, crossings.hardware_topics, crossings.gateways)
    ]
    assert counts == [(10, 3), (8, 2), (3, 1)]
    assert crossings.gateways == [
        Edge("n8", "A", publishes=False),
        Edge("n6", "C", publishes=False),
        Edge("n9", "E", publishes=True),
    ]


@pytest.mark.parametrize(
    ("publishers", "subscribers", "mapping", "reason"),
    [
        ("s", "t", TopicMapping.SOFTWARE, "All ends are in software"),
        ("s", "", TopicMapping.SOFTWARE, "All ends are in software"),
        ("h", "i", TopicMapping.HARDWARE, "All ends are in hardware"),
        ("h", "", TopicMapping.HARDWARE, "All ends are in hardware"),
        ("h", "s", TopicMapping.SOFTWARE, "no subscriber in hardware"),
        ("s", "h", TopicMapping.SOFTWARE, "one subscriber in hardware"),
        # Here a gateway would save a transfer, which the method does not look at.
        ("h", "is", TopicMapping.SOFTWARE, "gives a gateway to more than one, whatever publishes"),
        ("hs", "i", TopicMapping.SOFTWARE, "one subscriber in hardware"),
        ("s", "hi", TopicMapping.GATEWAY, "2 subscribers in hardware"),
        ("h", "ijs", TopicMapping.GATEWAY, "2 subscribers in hardware"),
        ("hs", "ij", TopicMapping.GATEWAY, "2 subscribers in hardware"),
    ],
)
def test_each_case_with_its_reason(
    publishers: str, subscribers: str, mapping: TopicMapping, reason: str
) -> None:
    nodes = dict.fromkeys("hij", HW) | dict.fromkeys("st", SW)
    graph = ComputationGraph(nodes, (Topic("A", tuple(publishers), tuple(subscribers)),))
    decision = map_topics(graph)["A"]
    assert decision.mapping is mapping
    assert reason in decision.reason


@given(graphs())
def test_the_conditions_as_the_paper_writes_them(graph: ComputationGraph) -> None:
    n_hw = {node for node, side in graph.nodes.items() if side is HW}
    n_sw = graph.nodes.keys() - n_hw
    mappings = mappings_of(graph)
    assert mappings.keys() == {topic.name for topic in graph.topics}
    for topic in graph.topics:
        if all(x in n_sw for x in topic.publishers) and all(y in n_sw for y in topic.subscribers):
            expected = TopicMapping.SOFTWARE
        elif all(x in n_hw for x in topic.publishers) and all(y in n_hw for y in topic.subscribers):
            expected = TopicMapping.HARDWARE
        elif len(n_hw.intersection(topic.subscribers)) > 1:
            expected = TopicMapping.GATEWAY
        else:
            expected = TopicMapping.SOFTWARE
        assert mappings[topic.name] is expected


@given(graphs())
def test_what_crosses_at_each_step(graph: ComputationGraph) -> None:
    mappings = mappings_of(graph)
    crossings = Crossings.of(graph, mappings)
    edges = [edge for topic in graph.topics for edge in topic.edges]
    touching = [edge for edge in edges if graph.nodes[edge.node] is HW]
    assert crossings.all_software == touching
    assert crossings.hardware_topics == [
        edge for edge in touching if mappings[edge.topic] is not TopicMapping.HARDWARE
    ]
    for topic in graph.topics:
        other_side = HW if mappings[topic.name] is TopicMapping.SOFTWARE else SW
        assert [edge for edge in crossings.gateways if edge.topic == topic.name] == [
            edge for edge in topic.edges if graph.nodes[edge.node] is other_side
        ]


def test_an_edge_crosses_where_node_and_topic_are_on_different_sides() -> None:
    graph = ComputationGraph({"h": HW, "s": SW}, (Topic("A", ("h",), ("s",)),))
    published, subscribed = graph.topics[0].edges
    assert crossing_edges(graph, {"A": TopicMapping.SOFTWARE}) == [published]
    assert crossing_edges(graph, {"A": TopicMapping.HARDWARE}) == [subscribed]
    assert crossing_edges(graph, {"A": TopicMapping.GATEWAY}) == [subscribed]
