"""The computation graph of a ReconROS project, read from its `build.cfg`."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from reconros_zenoh.mapping.communication import TopicMapping
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.project.communication import declared_type, endpoint_name, gateway_pair
from reconros_zenoh.ros.message_size import fixed_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.project.build_cfg import BuildConfiguration
    from reconros_zenoh.project.mapping_file import ProjectMapping
    from reconros_zenoh.project.resource_groups import Resource
    from reconros_zenoh.ros.type_registry import TypeRegistry

OUTSIDE = {"rospub": "(from outside)", "rossub": "(to outside)"}
"""The nodes, in software, that stand for publishers and subscribers elsewhere than in the project."""


class TopicEnd(NamedTuple):
    """A rossub or rospub of a project: its topic's full name, the threads that use it, and their sides."""

    resource: Resource
    node: str
    topic: str
    threads: tuple[str, ...]
    sides: frozenset[Side]


def gateway_topics(configuration: BuildConfiguration) -> dict[str, str]:
    """Return the full name of each gateway's hardware-mapped topic with that of its software-mapped one."""
    pairs = [gateway_pair(configuration.path, gateway) for gateway in configuration.gateways]
    return {pair.hmt: pair.smt for pair in pairs}


def topic_ends(configuration: BuildConfiguration, mapping: ProjectMapping) -> list[TopicEnd]:
    """Return all ends of topics in the order of the file; FileError for a name that ROS 2 does not allow.

    A thread is in hardware if `mapping` gives it a slot. A group that no thread uses belongs to main.py:
    software. The hardware-mapped topic of a gateway has the name of its software-mapped one, because both are
    one topic of the application.
    """
    gateways = gateway_topics(configuration)
    ends = []
    for resource in configuration.resources:
        if resource.type not in {"rossub", "rospub"}:
            continue
        assert resource.node is not None
        topic = endpoint_name(configuration.path, resource)
        if resource.hardware_mapped:
            topic = gateways.get(topic, topic)
        threads = tuple(
            thread.name for thread in configuration.threads if resource.group in thread.resource_groups
        )
        in_slots = {bool(mapping.callbacks[thread].slots) for thread in threads} or {False}
        sides = frozenset(Side.HARDWARE if each else Side.SOFTWARE for each in in_slots)
        ends.append(TopicEnd(resource, f"/{resource.node.lstrip('/')}", topic, threads, sides))
    return ends


def read_project_graph(
    configuration: BuildConfiguration, mapping: ProjectMapping, types: TypeRegistry | None = None
) -> ComputationGraph:
    """Return the graph of all nodes that have topics; see `topic_ends` for what is in hardware.

    With `types` a topic has the size of its messages where those of its type are all of one size; then
    FileError for a type that nobody defines.
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
    sizes = {end.topic: _fixed_bytes(configuration, end, types) for end in ends} if types else {}
    topics = tuple(
        Topic(name, tuple(of["rospub"]), tuple(of["rossub"]), sizes.get(name)) for name, of in found.items()
    )
    elsewhere = [name for name in OUTSIDE.values() if name in nodes]
    return ComputationGraph(nodes, topics, _notes(configuration, mapping, elsewhere))


def shared_slots(
    configuration: BuildConfiguration, mapping: ProjectMapping, mappings: Mapping[str, TopicMapping]
) -> list[str]:
    """Return a sentence for each two callbacks that share slots and are joined by a stream.

    Streams are the topics that `mappings` has in T_HW or T_GW.
    """
    ends = [
        end for end in topic_ends(configuration, mapping) if mappings[end.topic] is not TopicMapping.SOFTWARE
    ]
    publishers = [end for end in ends if end.resource.type == "rospub"]
    subscribers = [end for end in ends if end.resource.type == "rossub"]
    streams: dict[tuple[str, str], dict[str, None]] = {}
    for publisher, subscriber in product(publishers, subscribers):
        if publisher.topic == subscriber.topic:
            for pair in product(publisher.threads, subscriber.threads):
                streams.setdefault(pair, {})[publisher.topic] = None
    notes = []
    for (publishes, subscribes), topics in streams.items():
        first, second = (mapping.callbacks[name].slots for name in (publishes, subscribes))
        shared = sorted(set(first) & set(second))
        if shared and publishes != subscribes:
            notes.append(
                f"{publishes} and {subscribes} share slot{'s' * (len(shared) > 1)} "
                f"{', '.join(map(str, shared))}: a stream between them ({', '.join(topics)}) may block, or "
                "reconfigure a slot for each message."
            )
    return notes


def _fixed_bytes(configuration: BuildConfiguration, end: TopicEnd, types: TypeRegistry) -> int | None:
    return fixed_bytes(declared_type(configuration.path, end.resource, types.message))


def _notes(configuration: BuildConfiguration, mapping: ProjectMapping, outside: list[str]) -> tuple[str, ...]:
    types = {resource.type for resource in configuration.resources}
    notes = [f"Callbacks are where the mapping {mapping.name!r} has them; --mapping chooses another."]
    if types & {"rossrvs", "rossrvc", "rosactions", "rosactionc"}:
        notes.append("Services and actions are left out: they stay in software.")
    notes += [
        f"{name}, in software, stands for ends that the project does not have: clients, other boards."
        for name in outside
    ]
    notes.append("A topic with publishers and subscribers in the project is taken to have no others.")
    return tuple(notes)
