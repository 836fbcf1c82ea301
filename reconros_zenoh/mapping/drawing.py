"""Drawings of a mapped computation graph, after Mapping and Optimizing, Fig. 8: SVG, PNG, or DOT text.

matplotlib is imported where it draws, because it takes a second and most commands never draw.
"""

from __future__ import annotations

from itertools import accumulate, groupby, pairwise
from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import UsageError
from reconros_zenoh.mapping.communication import TopicMapping, crossing_edges
from reconros_zenoh.mapping.layout import Vertex, ends_of, in_hardware, lay_out

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from reconros_zenoh.mapping.graph import ComputationGraph
    from reconros_zenoh.mapping.layout import Layout, Place

_INK = "#24292f"
_EDGE = "#7a8794"
_CROSSING = "#c2485a"
_SHADE = "#e3edf7"
_COLOURS = {
    TopicMapping.SOFTWARE: "#ffffff",
    TopicMapping.HARDWARE: "#bcd6ee",
    TopicMapping.GATEWAY: "#f6c667",
}
_NAMES = {TopicMapping.SOFTWARE: "SMT", TopicMapping.HARDWARE: "HMT", TopicMapping.GATEWAY: "gateway"}
_LEGEND_TEXTS = {
    TopicMapping.SOFTWARE: "topic in software (SMT)",
    TopicMapping.HARDWARE: "in hardware (HMT)",
    TopicMapping.GATEWAY: "with a gateway",
}
_BOX, _LETTER, _GAP, _ROW, _STRIP, _LEGEND = 0.42, 0.085, 0.75, 0.62, 0.35, 6.3
"""Heights of box, row and strips above and below, widths of a letter, a gap and the legend [inch]."""
_MOST_PIXELS = 30_000  # matplotlib draws no more than 2**16 in a row
_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "text.color": _INK,
    "text.parse_math": False,  # a $ in a name is a $
    "svg.hashsalt": "reconros",
}


def write_drawing(path: Path, graph: ComputationGraph, mappings: Mapping[str, TopicMapping]) -> None:
    """Write the drawing to a `.svg`, `.png` or `.dot` file, the same one each time.

    Nodes are round, topics are boxes, the hardware side is shaded, and the edges over the boundary are red.
    Raise UsageError for another suffix or a file that cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in {".svg", ".png", ".dot"}:
        raise UsageError(f"{path}: drawings are written as svg, png or dot. Name the file *.svg.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if suffix == ".dot":
            path.write_text(dot(graph, mappings), encoding="utf-8")
            return
        import matplotlib as mpl  # noqa: PLC0415  see the module docstring

        with mpl.rc_context(_STYLE):
            drawn = draw(graph, mappings)
            dpi = min(150, _MOST_PIXELS / max(drawn.get_size_inches()))
            drawn.savefig(path, dpi=dpi, metadata={"Date": None} if suffix == ".svg" else None)
    except OSError as error:
        raise UsageError(
            f"{path}: the drawing cannot be written: {error.strerror}. Choose a folder that you may write to."
        ) from None


def dot(graph: ComputationGraph, mappings: Mapping[str, TopicMapping]) -> str:
    """Return the graph in the language of Graphviz, the hardware side as a shaded cluster."""
    crossing = set(crossing_edges(graph, mappings))
    vertices = [Vertex(name, is_topic=False) for name in graph.nodes]
    vertices += [Vertex(topic.name, is_topic=True) for topic in graph.topics]
    lines = ["digraph mapping {", "  rankdir=LR;", "  subgraph cluster_hardware {"]
    lines += [f'    label="hardware"; style=filled; color="{_SHADE}";']
    lines += [f"    {_dot_vertex(v, mappings)}" for v in vertices if in_hardware(graph, mappings, v)]
    lines += ["  }"]
    lines += [f"  {_dot_vertex(v, mappings)}" for v in vertices if not in_hardware(graph, mappings, v)]
    for topic in graph.topics:
        for edge in topic.edges:
            source, target = ends_of(edge)
            mark = f' [color="{_CROSSING}", penwidth=2]' if edge in crossing else ""
            lines.append(f"  {_dot_id(source)} -> {_dot_id(target)}{mark};")
    return "\n".join([*lines, "}", ""])


def _dot_vertex(vertex: Vertex, mappings: Mapping[str, TopicMapping]) -> str:
    if not vertex.is_topic:
        return f'{_dot_id(vertex)} [label={_quoted(vertex.name)}, style=filled, fillcolor="white"];'
    mapping = mappings[vertex.name]
    label = _quoted(f"{vertex.name}\n{_NAMES[mapping]}")
    return f'{_dot_id(vertex)} [label={label}, shape=box, style=filled, fillcolor="{_COLOURS[mapping]}"];'


def _dot_id(vertex: Vertex) -> str:
    return _quoted(f"{'topic' if vertex.is_topic else 'node'} {vertex.name}")


def _quoted(text: str) -> str:
    text = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{text}"'


def draw(graph: ComputationGraph, mappings: Mapping[str, TopicMapping]) -> Figure:
    """Return the drawing; its units are inches, its origin is where the boundary begins."""
    from matplotlib.figure import Figure  # noqa: PLC0415  see the module docstring
    from matplotlib.patches import Rectangle  # noqa: PLC0415

    layout = lay_out(graph, mappings)
    widths = {vertex: _width(vertex, mappings) for vertex in layout.vertices}
    columns = _columns(layout, widths)
    centres = [(left + right) / 2 for left, right in columns]
    rows = [place.row for way in (*layout.ways.values(), layout.vertices.values()) for place in way]
    top, bottom = ((row + 1) * _ROW for row in (max(rows, default=0), min(rows, default=-1) - 1))
    right = max(columns[-1][1] + _GAP, _LEGEND)
    figure = Figure(figsize=(right, top - bottom + 3 * _STRIP))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, right), ylim=(bottom - 2 * _STRIP, top + _STRIP))
    axes.set_axis_off()
    axes.add_patch(Rectangle((0, 0), right, top + _STRIP, color=_SHADE, linewidth=0))
    axes.text(0.1, top + _STRIP - 0.1, "hardware", va="top", fontstyle="italic")
    axes.text(0.1, bottom, "software", va="top", fontstyle="italic")
    crossing = set(crossing_edges(graph, mappings))
    for edge, way in layout.ways.items():
        points = _way(way, columns, [widths[vertex] / 2 for vertex in ends_of(edge)])
        _draw_edge(axes, points, edge in crossing)
    for vertex, (column, row) in layout.vertices.items():
        _draw_vertex(axes, vertex, mappings, (centres[column], _height(row)), widths[vertex])
    _draw_legend(axes, bottom - 1.5 * _STRIP, len(crossing))
    return figure


def _width(vertex: Vertex, mappings: Mapping[str, TopicMapping]) -> float:
    lines = [vertex.name, *([_NAMES[mappings[vertex.name]]] if vertex.is_topic else [])]
    return max(_BOX, max(map(len, lines)) * _LETTER + 0.2)


def _columns(layout: Layout, widths: Mapping[Vertex, float]) -> list[tuple[float, float]]:
    """Return where each column begins and ends: it is as wide as its widest vertex."""
    columns = [0.0] * (1 + max((place.column for place in layout.vertices.values()), default=0))
    for vertex, place in layout.vertices.items():
        columns[place.column] = max(columns[place.column], widths[vertex])
    starts = accumulate((width + _GAP for width in columns), initial=_GAP)
    return [(start, start + width) for start, width in zip(starts, columns, strict=False)]


def _way(
    places: list[Place], columns: list[tuple[float, float]], half_widths: list[float]
) -> list[tuple[float, float]]:
    """Return the points of an edge: in each column it is level, so that it passes behind nothing."""
    forward = places[0].column < places[-1].column
    points = []
    for column, row in places:
        near, far = columns[column] if forward else columns[column][::-1]
        points += [(near, _height(row)), (far, _height(row))]
    for end, half_width in ((0, half_widths[0]), (-1, -half_widths[1])):
        centre = sum(columns[places[end].column]) / 2
        points[end] = (centre + (half_width if forward else -half_width), points[end][1])
    # The widest vertex ends with its column; between points that are one an arrow has no direction.
    return [point for point, _ in groupby((round(x, 6), y) for x, y in points)]


def _height(row: int) -> float:
    return (row + 0.5) * _ROW


def _draw_vertex(
    axes: Axes,
    vertex: Vertex,
    mappings: Mapping[str, TopicMapping],
    centre: tuple[float, float],
    width: float,
) -> None:
    from matplotlib.patches import Ellipse, Rectangle  # noqa: PLC0415  see the module docstring

    if not vertex.is_topic:
        axes.add_patch(Ellipse(centre, width, _BOX, facecolor="white", edgecolor=_INK, zorder=3))
        axes.text(*centre, vertex.name, ha="center", va="center", zorder=4)
        return
    mapping = mappings[vertex.name]
    corner = (centre[0] - width / 2, centre[1] - _BOX / 2)
    axes.add_patch(Rectangle(corner, width, _BOX, facecolor=_COLOURS[mapping], edgecolor=_INK, zorder=3))
    axes.text(*centre, vertex.name, ha="center", va="bottom", zorder=4, fontweight="bold")
    axes.text(*centre, _NAMES[mapping], ha="center", va="top", zorder=4, fontsize=7)


def _draw_edge(axes: Axes, points: list[tuple[float, float]], crosses: bool) -> None:
    """Draw an arrow through the points, level at each of them."""
    from matplotlib.patches import FancyArrowPatch  # noqa: PLC0415  see the module docstring
    from matplotlib.path import Path as Way  # noqa: PLC0415

    vertices, codes = [points[0]], [Way.MOVETO]
    for (x, y), (next_x, next_y) in pairwise(points):
        middle = (x + next_x) / 2
        vertices += [(middle, y), (middle, next_y), (next_x, next_y)]
        codes += [Way.CURVE4] * 3
    axes.add_patch(
        FancyArrowPatch(
            path=Way(vertices, codes),
            arrowstyle="-|>",
            mutation_scale=9,
            color=_CROSSING if crosses else _EDGE,
            linewidth=2 if crosses else 1,
            zorder=2,
        )
    )


def _draw_legend(axes: Axes, y: float, crossing: int) -> None:
    from matplotlib.patches import Rectangle  # noqa: PLC0415  see the module docstring

    x = 0.1
    for mapping, text in _LEGEND_TEXTS.items():
        axes.add_patch(Rectangle((x, y - 0.07), 0.2, 0.14, facecolor=_COLOURS[mapping], edgecolor=_INK))
        axes.text(x + 0.26, y, text, va="center", fontsize=7.5)
        x += 0.4 + 0.062 * len(text)
    axes.plot((x, x + 0.25), (y, y), color=_CROSSING, linewidth=2)
    axes.text(x + 0.31, y, f"crosses the boundary ({crossing})", va="center", fontsize=7.5)
