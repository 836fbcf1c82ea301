"""The computation graph of a ReconROS project, read from its `build.cfg`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.project.communication import endpoint_name, gateway_pair

if TYPE_CHECKING:
    from reconros_zenoh.project.build_cfg import BuildConfiguration, ReconosThread
    from reconros_zenoh.project.mapping_file import Mapping
    from reconros_zenoh.project.resource_groups import Resource

OUTSIDE = {"rospub": "(from outside)", "rossub": "(to outside)"}
"""The nodes, in software, that stand for publishers and subscribers elsewhere than in the project."""


class TopicEnd(NamedTuple):
    """A rossub or rospub of a project: its topic's full name, and the sides of the threads that use it."""

    resource: Resource
    node: str
    topic: str
    sides: frozenset[Side]


def gateway_topics(configuration: BuildConfiguration) -> dict[str, str]:
    """Return the full name of each gateway's hardware-mapped topic with that of its software-mapped one."""
    pairs = [gateway_pair(configuration.path, gateway) for gateway in configuration.gateways]
    return {pair.hmt: pair.smt for pair in pairs}


def topic_ends(configuration: BuildConfiguration, mapping: Mapping | None = None) -> list[TopicEnd]:
    """Return all ends of topics in the order of the file; FileError for a name that ROS 2 does not allow.

    A thread is in hardware if `mapping` gives it a slot, without a mapping if it has a hardware source. A
    group that no thread uses belongs to main.py: software. The hardware-mapped topic of a gateway has the
    name of its software-mapped one, because both are one topic of the application.
    """
    gateways = gateway_topics(configuration)
    sides: dict[str, set[Side]] = {}
    for thread in configuration.threads:
        for group in thread.resource_groups:
            sides.setdefault(group, set()).add(_side(thread, mapping))
    ends = []
    for resource in configuration.resources:
        if resource.type not in {"rossub", "rospub"}:
            continue
        assert resource.node is not None
        topic = endpoint_name(configuration.path, resource)
        if resource.hardware_mapped:
            topic = gateways.get(topic, topic)
        used_on = frozenset(sides.get(resource.group, {Side.SOFTWARE}))
        ends.append(TopicEnd(resource, f"/{resource.node.lstrip('/')}", topic, used_on))
    return ends


def read_project_graph(configuration: BuildConfiguration, mapping: Mapping | None = None) -> ComputationGraph:
    """Return the graph of all nodes that have topics; see `topic_ends` for what is in hardware.

    A ROS node with callbacks on both sides becomes a node on each. A topic of which the project has only
    publishers, or only subscribers, has its other ends elsewhere, where nothing is in hardware: a node of
    OUTSIDE stands for them. One also subscribes to a topic that has a gateway and no end in software.
    """
    ends = topic_ends(configuration, mapping)
    sides_of: dict[str, set[Side]] = {}
    for end in ends:
        sides_of.setdefault(end.node, set()).update(end.sides)
    nodes: dict[str, Side] = {}
    found: dict[str, dict[str, dict[str, None]]] = {}  # names as keys: each once, in the order of the file
    for end in ends:
        topic = found.setdefault(end.topic, {"rospub": {}, "rossub": {}})
        for side in sorted(end.sides):
            name = end.node if len(sides_of[end.node]) == 1 else f"{end.node} ({side})"
            nodes[name] = side
            topic[end.resource.type][name] = None
    for topic in found.values():
        for kind, outside in OUTSIDE.items():
            if not topic[kind]:
                topic[kind][outside] = None
                nodes[outside] = Side.SOFTWARE
    for name in gateway_topics(configuration).values():
        if name in found and all(nodes[node] is Side.HARDWARE for of in found[name].values() for node in of):
            found[name]["rossub"][OUTSIDE["rossub"]] = None
            nodes[OUTSIDE["rossub"]] = Side.SOFTWARE
    topics = tuple(Topic(name, tuple(of["rospub"]), tuple(of["rossub"])) for name, of in found.items())
    elsewhere = [name for name in OUTSIDE.values() if name in nodes]
    return ComputationGraph(nodes, topics, _notes(configuration, elsewhere))


def _side(thread: ReconosThread, mapping: Mapping | None) -> Side:
    in_hardware = thread.hardware is not None if mapping is None else mapping.callbacks[thread.name].slots
    return Side.HARDWARE if in_hardware else Side.SOFTWARE


def _notes(configuration: BuildConfiguration, outside: list[str]) -> tuple[str, ...]:
    types = {resource.type for resource in configuration.resources}
    notes = []
    if types & {"rossrvs", "rossrvc", "rosactions", "rosactionc"}:
        notes.append("Services and actions are left out: they stay in software.")
    notes += [
        f"{name}, in software, stands for ends that the project does not have: clients, other boards."
        for name in outside
    ]
    notes.append("A topic with publishers and subscribers in the project is taken to have no others.")
    return tuple(notes)
