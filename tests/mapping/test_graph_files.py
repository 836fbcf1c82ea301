"""Graph files, and every mistake in them with its line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.errors import FileError, GraphError
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.mapping.graph_file import read_graph_file

if TYPE_CHECKING:
    from pathlib import Path

NODES = "nodes: {n1: hardware, n2: software}\ntopics:\n"


def read(folder: Path, text: str) -> ComputationGraph:
    path = folder / "graph.yaml"
    path.write_text(text, encoding="utf-8")
    return read_graph_file(path)


def test_what_a_file_says(tmp_path: Path) -> None:
    graph = read(
        tmp_path,
        NODES + "  A: {publishers: [n1], subscribers: [n2, n1], size: 6_220_800, rate: 29.97}\n"
        "  /b/c:\n    publishers:\n    - n2\n",
    )
    assert graph == ComputationGraph(
        {"n1": Side.HARDWARE, "n2": Side.SOFTWARE},
        (Topic("A", ("n1",), ("n2", "n1"), 6_220_800, 29.97), Topic("/b/c", ("n2",), ())),
    )
    assert graph.warnings == ("topic /b/c has no subscriber.",)


def test_a_graph_may_have_no_topic(tmp_path: Path) -> None:
    assert read(tmp_path, "nodes: {}\ntopics: {}") == ComputationGraph({}, ())


MISTAKES = {
    "no nodes": ("topics: {}", 1, "has no nodes"),
    "no topics": ("nodes: {}", 1, "has no topics"),
    "a key nobody knows": ("nodes: {}\ntopics: {}\nedges: {}", 3, "edges is not a key of a graph file"),
    "a side nobody knows": ("nodes:\n  n1: fpga\ntopics: {}", 2, "nodes.n1 is 'fpga'. Write hardware or"),
    "a node without a side": ("nodes:\n  n1:\ntopics: {}", 2, "nodes.n1 must be a string"),
    "a node that stands twice": ("nodes:\n  n1: hardware\n  n1: software\n", 3, "n1 stands twice"),
    "a node with a number for a name": (
        "nodes: {1: hardware}\ntopics: {}",
        1,
        "not a string. Put it in quot",
    ),
    "a node with an empty name": ("nodes:\n  : hardware\ntopics: {}", 1, "nodes has the key None"),
    "a topic mapped twice": (
        NODES + "  A: {publishers: [n1]}\n  B: {publishers: [n1]}\n  A: {publishers: [n2]}\n",
        5,
        "A stands twice",
    ),
    "an unknown publisher": (
        NODES + "  A: {publishers: [n9]}",
        3,
        "publishers.item 1 is the unknown node 'n9'. Known nodes: n1, n2.",
    ),
    "an unknown subscriber": (
        NODES + "  A:\n    publishers: [n1]\n    subscribers:\n    - n1\n    - n9\n",
        7,
        "subscribers.item 2 is the unknown node 'n9'",
    ),
    "no publishers": (NODES + "  A: {subscribers: [n1]}", 3, "topics.A has no publisher"),
    "brackets without end": (NODES + "  A: " + "[" * 3000, 3, "nested too deeply"),
    "levels without end": (
        "nodes:\n" + "\n".join(" " * level + "a:" for level in range(1, 99)),
        50,
        "nested too deeply",
    ),
    "a number without end": (
        NODES + "  A: {publishers: [n1],\n    size: " + "9" * 5000 + "}",
        4,
        "cannot be read",
    ),
    "a hexadecimal one": (NODES + "  A: {publishers: [n1],\n    size: 0x" + "f" * 5000 + "}", 4, "64 bits"),
    "one in quotes": (NODES + "  A: {publishers: [n1], size: '" + "9" * 5000 + "'}", 3, "a whole number"),
    "a date that is none": (NODES + "  A: {publishers: [n1],\n    rate: 2001-99-99}", 4, "month must be in"),
    "a tag that does not fit": (NODES + "  A: {publishers: [n1],\n    size: !!int x}", 4, "cannot be read"),
    "a mapping that is merged into itself": ("nodes: &a\n  <<: *a\ntopics: {}", 1, "cannot be read"),
    "a key that is a list": ("a: &a [[x]]\n? *a\n: b", 3, "cannot be read"),
    "a node that tells a terminal what to do": (
        'nodes:\n  "\\x1b]0;mine": hardware\ntopics: {}',
        2,
        "cannot be printed",
    ),
    "a topic in two lines": (NODES + '  "a\\nb": {publishers: [n1]}', 3, "cannot be printed"),
    "an empty list of publishers": (NODES + "  A:\n    publishers: []", 3, "topics.A has no publisher"),
    "one node for a list": (NODES + "  A: {publishers: n1}", 3, "must be a list"),
    "a node that is a number": (NODES + "  A: {publishers: [1]}", 3, "must be a string"),
    "a node twice": (NODES + "  A: {publishers: [n1,\n    n1]}", 4, "item 2 names 'n1' again"),
    "a topic of nothing": (NODES + "  A:", 3, "topics.A must be a mapping"),
    "a misspelt key": (NODES + "  A: {publishers: [n1], subscriber: [n2]}", 3, "subscriber is not a key"),
    "a size in words": (NODES + "  A: {publishers: [n1], size: 1 MB}", 3, "must be a whole number"),
    "a size of nothing": (NODES + "  A: {publishers: [n1],\n    size: 0}", 4, "topics.A.size is 0"),
    "a rate in words": (NODES + "  A: {publishers: [n1], rate: often}", 3, "rate must be a number"),
    "a rate of nothing": (NODES + "  A: {publishers: [n1], rate: 0}", 3, "topics.A.rate is 0"),
    "a rate without end": (NODES + "  A: {publishers: [n1], rate: .inf}", 3, "rate is inf"),
    "a rate that is none": (NODES + "  A: {publishers: [n1], rate: .nan}", 3, "rate is nan"),
    "no YAML": ("nodes: {", 1, "is not YAML"),
}


@pytest.mark.parametrize(("text", "line", "says"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, text: str, line: int, says: str) -> None:
    with pytest.raises(FileError) as caught:
        read(tmp_path, text)
    assert (caught.value.path, caught.value.line) == (tmp_path / "graph.yaml", line)
    assert says in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"gone\.yaml: cannot be read"):
        read_graph_file(tmp_path / "gone.yaml")


def test_a_graph_built_in_a_program_is_checked_as_well() -> None:
    with pytest.raises(GraphError, match=r"topics\.A\.publishers\.0 is the unknown node 'n2'") as caught:
        ComputationGraph({"n1": Side.HARDWARE}, (Topic("A", ("n2",), ()),))
    assert caught.value.place == ("topics", "A", "publishers", 0)
    topic = Topic("A", ("n1",), ())
    with pytest.raises(GraphError, match=r"topics\.A stands twice"):
        ComputationGraph({"n1": Side.HARDWARE}, (topic, topic))
