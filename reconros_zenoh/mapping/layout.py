"""Where nodes and topics stand in a drawing: columns along the messages, hardware above software."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from statistics import mean
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import networkx as nx

from reconros_zenoh.mapping.communication import TopicMapping
from reconros_zenoh.mapping.graph import Side

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from reconros_zenoh.mapping.graph import ComputationGraph, Edge

_SWEEPS = 4


class Vertex(NamedTuple):
    """A node or a topic; both may have the same name."""

    name: str
    is_topic: bool


class Place(NamedTuple):
    """A column from the left, and a row: 0, 1, ... upwards in hardware, -1, -2, ... down in software."""

    column: int
    row: int


class _Bend(NamedTuple):
    """A place that an edge over several columns keeps free in one of them."""

    edge: Edge
    column: int


_Item: TypeAlias = Vertex | _Bend


class Layout(NamedTuple):
    """The places of the vertices, no two the same, and the way of each edge over its ends and bends."""

    vertices: dict[Vertex, Place]
    ways: dict[Edge, list[Place]]


def in_hardware(graph: ComputationGraph, mappings: Mapping[str, TopicMapping], vertex: Vertex) -> bool:
    """Tell on which side of the boundary a vertex is; a topic with a gateway is in hardware."""
    if vertex.is_topic:
        return mappings[vertex.name] is not TopicMapping.SOFTWARE
    return graph.nodes[vertex.name] is Side.HARDWARE


def lay_out(graph: ComputationGraph, mappings: Mapping[str, TopicMapping]) -> Layout:
    """Return a layered layout: a vertex stands right of those it gets messages from, but where they circle.

    Rows follow the mean row of the neighbours (Sugiyama's method), so that few edges cross each other.
    """
    columns = _columns(graph)
    chains: dict[Edge, list[_Item]] = {}
    side: dict[_Item, bool] = {}
    where: dict[_Item, int] = {}
    for vertex, column in columns.items():
        side[vertex] = in_hardware(graph, mappings, vertex)
        where[vertex] = column
    for topic in graph.topics:
        for edge in topic.edges:
            source, target = ends_of(edge)
            first, last = columns[source], columns[target]
            step = 1 if first < last else -1
            bends = [_Bend(edge, column) for column in range(first + step, last, step)]
            chains[edge] = [source, *bends, target]
            for bend in bends:
                side[bend] = side[source]
                where[bend] = bend.column
    rows = _rows(side, where, chains.values())
    places = {item: Place(where[item], rows[item]) for item in where}
    return Layout(
        {vertex: places[vertex] for vertex in columns},
        {edge: [places[item] for item in chain] for edge, chain in chains.items()},
    )


def ends_of(edge: Edge) -> tuple[Vertex, Vertex]:
    """Return where the edge comes from and where it goes to."""
    node, topic = Vertex(edge.node, is_topic=False), Vertex(edge.topic, is_topic=True)
    return (node, topic) if edge.publishes else (topic, node)


def _columns(graph: ComputationGraph) -> dict[Vertex, int]:
    """Return the columns by the longest way that messages take, without the last edge of each circle."""
    network: nx.DiGraph[Vertex] = nx.DiGraph()
    network.add_nodes_from(Vertex(name, is_topic=False) for name in graph.nodes)
    network.add_edges_from(ends_of(edge) for topic in graph.topics for edge in topic.edges)
    while not nx.is_directed_acyclic_graph(network):
        network.remove_edge(*nx.find_cycle(network)[-1])
    return {
        vertex: column
        for column, vertices in enumerate(nx.topological_generations(network))
        for vertex in vertices
    }


def _rows(
    side: Mapping[_Item, bool], where: Mapping[_Item, int], chains: Iterable[list[_Item]]
) -> dict[_Item, int]:
    """Return the rows: in each column both sides count away from the boundary."""
    neighbours: defaultdict[_Item, list[_Item]] = defaultdict(list)
    for chain in chains:
        for one, other in pairwise(chain):
            neighbours[one].append(other)
            neighbours[other].append(one)
    stacks: defaultdict[tuple[int, bool], list[_Item]] = defaultdict(list)
    for item, column in where.items():
        stacks[column, side[item]].append(item)
    rows: dict[_Item, int] = {}

    def stack_up(items: list[_Item], *, hardware: bool) -> None:
        for index, item in enumerate(items):
            rows[item] = index if hardware else -1 - index

    for (_, hardware), items in stacks.items():
        stack_up(items, hardware=hardware)
    for sweep in range(_SWEEPS):
        to_right = sweep % 2 == 0
        for (column, hardware), items in sorted(stacks.items(), reverse=not to_right):
            weights = {
                item: mean(
                    [rows[other] for other in neighbours[item] if (where[other] < column) is to_right]
                    or [rows[item]]
                )
                for item in items
            }
            items.sort(key=weights.__getitem__, reverse=not hardware)
            stack_up(items, hardware=hardware)
    return rows
