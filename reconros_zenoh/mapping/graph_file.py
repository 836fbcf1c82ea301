"""Graph files: a computation graph with its node mapping, as YAML."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.errors import GraphError
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.yaml_node import YamlNode

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from pathlib import Path

_TOPIC_KEYS = ("publishers", "subscribers", "size", "rate")


def read_graph_file(path: Path) -> ComputationGraph:
    """Return the graph that the file describes; FileError names the line of the first mistake.

    `nodes` maps each node to `hardware` or `software`, `topics` each topic to its `publishers`, `subscribers`
    and, where they are known, `size` [bytes] and `rate` [messages per second].
    """
    root = YamlNode.read(path, {})
    entries = root.mapping()
    _check_keys(entries, ("nodes", "topics"))
    for key in ("nodes", "topics"):
        if key not in entries:
            raise root.error(f"has no {key}.", f"Add a `{key}:` mapping.")
    nodes = {name: _side(node) for name, node in entries["nodes"].mapping().items()}
    topics = tuple(_topic(name, node) for name, node in entries["topics"].mapping().items())
    try:
        return ComputationGraph(nodes, topics)
    except GraphError as error:
        raise _find(root, error.place).error(error.problem, error.remedy) from None


def _side(node: YamlNode) -> Side:
    text = node.text()
    if text not in set(Side):
        raise node.error(f"is {text!r}.", f"Write {' or '.join(Side)}.")
    return Side(text)


def _topic(name: str, node: YamlNode) -> Topic:
    entries = node.mapping()
    _check_keys(entries, _TOPIC_KEYS)
    ends = {
        key: tuple(item.text() for item in entries[key].sequence()) if key in entries else ()
        for key in ("publishers", "subscribers")
    }
    return Topic(
        name,
        ends["publishers"],
        ends["subscribers"],
        entries["size"].whole_number() if "size" in entries else None,
        entries["rate"].number() if "rate" in entries else None,
    )


def _check_keys(entries: Mapping[str, YamlNode], known: Collection[str]) -> None:
    for key, node in entries.items():
        if key not in known:
            raise node.error("is not a key of a graph file.", f"Known here: {', '.join(known)}.")


def _find(node: YamlNode, place: tuple[str | int, ...]) -> YamlNode:
    for key in place:
        node = node.sequence()[key] if isinstance(key, int) else node.mapping()[key]
    return node
