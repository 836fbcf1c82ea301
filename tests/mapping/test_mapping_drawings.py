"""Drawings: places, DOT, and files."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given, settings
from mapped_graphs import EXAMPLE, graphs

from reconros_zenoh.errors import UsageError
from reconros_zenoh.mapping.communication import TopicMapping, crossing_edges, map_topics
from reconros_zenoh.mapping.drawing import _columns, _way, _width, dot, write_drawing
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.mapping.graph_file import read_graph_file
from reconros_zenoh.mapping.layout import ends_of, in_hardware, lay_out

if TYPE_CHECKING:
    from pathlib import Path


def mappings_of(graph: ComputationGraph) -> dict[str, TopicMapping]:
    return {name: decision.mapping for name, decision in map_topics(graph).items()}


@given(graphs())
def test_every_vertex_has_a_place_of_its_own_on_its_side(graph: ComputationGraph) -> None:
    mappings = mappings_of(graph)
    layout = lay_out(graph, mappings)
    assert len(layout.vertices) == len(graph.nodes) + len(graph.topics)
    assert len(set(layout.vertices.values())) == len(layout.vertices)
    for vertex, place in layout.vertices.items():
        assert (place.row >= 0) is in_hardware(graph, mappings, vertex)


@given(graphs())
def test_edges_go_from_end_to_end_past_everything_else(graph: ComputationGraph) -> None:
    layout = lay_out(graph, mappings_of(graph))
    assert set(layout.ways) == {edge for topic in graph.topics for edge in topic.edges}
    taken = set(layout.vertices.values())
    for edge, way in layout.ways.items():
        source, target = ends_of(edge)
        assert (way[0], way[-1]) == (layout.vertices[source], layout.vertices[target])
        steps = {after.column - before.column for before, after in pairwise(way)}
        assert len(steps) == 1
        assert steps < {1, -1} or len(way) == 2
        assert taken.isdisjoint(way[1:-1])


def test_messages_go_to_the_right() -> None:
    graph = read_graph_file(EXAMPLE)
    layout = lay_out(graph, mappings_of(graph))
    for way in layout.ways.values():
        assert way[0].column < way[-1].column


def test_a_circle_is_cut_once() -> None:
    nodes = {"red": Side.HARDWARE, "green": Side.HARDWARE}
    topics = (Topic("r", ("red",), ("green",)), Topic("g", ("green",), ("red",)))
    graph = ComputationGraph(nodes, topics)
    ways = lay_out(graph, mappings_of(graph)).ways.values()
    assert sum(way[0].column > way[-1].column for way in ways) == 1


def test_dot_has_every_vertex_and_edge() -> None:
    graph = read_graph_file(EXAMPLE)
    mappings = mappings_of(graph)
    text = dot(graph, mappings)
    shaded = text[text.index("subgraph") : text.index("\n  }")]
    in_fabric = {f"n{number}" for number in (1, 2, 3, 4, 5, 7, 10, 11)}
    assert set(re.findall(r'"node (\w+)" \[', shaded)) == in_fabric
    assert set(re.findall(r'"topic (\w+)" \[.*?shape=box', shaded)) == {"A", "B", "C", "E"}
    edges = re.findall(r'"(?:node|topic) (\w+)" -> "(?:node|topic) (\w+)"( \[color)?', text)
    assert len(edges) == sum(len(list(topic.edges)) for topic in graph.topics)
    assert {(a, b) for a, b, marked in edges if marked} == {("A", "n8"), ("C", "n6"), ("n9", "E")}
    assert len(crossing_edges(graph, mappings)) == 3


def test_names_in_dot_are_quoted() -> None:
    graph = ComputationGraph({'a"b\\': Side.SOFTWARE}, (Topic("A", ('a"b\\',), ()),))
    assert r'"node a\"b\\" -> "topic A";' in dot(graph, mappings_of(graph))


@pytest.mark.parametrize("suffix", ["svg", "png", "dot"])
def test_a_drawing_is_the_same_each_time(tmp_path: Path, suffix: str) -> None:
    graph = read_graph_file(EXAMPLE)
    one, other = (tmp_path / folder / f"graph.{suffix}" for folder in ("one", "other"))
    for path in (one, other):
        write_drawing(path, graph, mappings_of(graph))
    assert one.read_bytes() == other.read_bytes()
    if suffix == "png":
        assert one.read_bytes().startswith(b"\x89PNG")


def test_the_svg_shows_what_the_issue_asks_for(tmp_path: Path) -> None:
    graph = read_graph_file(EXAMPLE)
    path = tmp_path / "graph.svg"
    write_drawing(path, graph, mappings_of(graph))
    text = path.read_text(encoding="utf-8")
    ET.fromstring(text)
    for words in ("n11", "gateway", "HMT", "SMT", "hardware", "software", "crosses the boundary (3)"):
        assert f"<!-- {words} -->" in text
    # Three crossing edges (line and head of each) and the legend's.
    assert len(re.findall(r"stroke: #c2485a; stroke-width: 2", text)) == 2 * 3 + 1


@settings(max_examples=15)
@given(graph=graphs(max_topics=3))
def test_every_graph_can_be_drawn(tmp_path_factory: pytest.TempPathFactory, graph: ComputationGraph) -> None:
    path = tmp_path_factory.mktemp("drawn") / "graph.svg"
    write_drawing(path, graph, mappings_of(graph))
    assert path.stat().st_size


def test_a_graph_of_nothing_can_be_drawn(tmp_path: Path) -> None:
    write_drawing(tmp_path / "graph.svg", ComputationGraph({}, ()), {})
    assert "crosses the boundary (0)" in (tmp_path / "graph.svg").read_text(encoding="utf-8")


def test_what_cannot_be_written(tmp_path: Path) -> None:
    graph = ComputationGraph({}, ())
    with pytest.raises(UsageError, match=r"graph\.pdf: drawings are written as svg, png or dot"):
        write_drawing(tmp_path / "graph.pdf", graph, {})
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot be written"):
        write_drawing(tmp_path / "file" / "graph.svg", graph, {})


def test_a_long_chain_is_drawn_smaller(tmp_path: Path) -> None:
    names = [f"n{number}" for number in range(300)]
    topics = tuple(Topic(f"t{a}", (a,), (b,)) for a, b in pairwise(names))
    graph = ComputationGraph(dict.fromkeys(names, Side.SOFTWARE), topics)
    write_drawing(tmp_path / "graph.png", graph, mappings_of(graph))
    width = int.from_bytes((tmp_path / "graph.png").read_bytes()[16:20], "big")
    assert 25_000 < width <= 30_000


def ends(column: tuple[float, float], width: float) -> tuple[float, float]:
    """Return where a vertex of this width begins and ends in its column."""
    middle = sum(column) / 2
    return middle - width / 2, middle + width / 2


@given(graphs())
def test_no_edge_passes_behind_a_vertex(graph: ComputationGraph) -> None:
    mappings = mappings_of(graph)
    layout = lay_out(graph, mappings)
    widths = {vertex: _width(vertex, mappings) for vertex in layout.vertices}
    columns = _columns(layout, widths)
    for edge, places in layout.ways.items():
        source, target = ends_of(edge)
        points = _way(places, columns, [widths[source] / 2, widths[target] / 2])
        forward = points[0][0] < points[-1][0]
        first, last = (ends(columns[layout.vertices[end].column], widths[end]) for end in (source, target))
        assert points[0][0] == pytest.approx(first[forward])
        assert points[-1][0] == pytest.approx(last[not forward])
        for (x, y), (next_x, next_y) in pairwise(points):
            assert x != next_x
            # It changes its height between two columns only.
            if y != next_y:
                borders = sorted((x, next_x))
                assert any(
                    borders == pytest.approx([end, start]) for (_, end), (start, _) in pairwise(columns)
                )
