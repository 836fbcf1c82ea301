"""A ReconROS project on a board: its resources as endpoints."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from reconros_zenoh.board.endpoints import ServiceSource, SubscriptionSource, TimerSource
from reconros_zenoh.board.hmt import HmtSource, HmtWriter
from reconros_zenoh.errors import UsageError
from reconros_zenoh.project.communication import topic_name
from reconros_zenoh.ros.names import resolve

if TYPE_CHECKING:
    from pathlib import Path

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.endpoints import MessageWriter, Source
    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.hmt import HardwareTopic
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import Mapping
    from reconros_zenoh.project.resource_groups import Resource
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.types import TypeRegistry


T = TypeVar("T")


class Application:
    """What main.py of a project works with: the board, the mapping, and the resources of build.cfg by name.

    `bitstreams` is the folder of the partial bitstreams, None to hold them in memory only.
    """

    def __init__(
        self, project: Project, board: Board, mapping: Mapping, types: TypeRegistry, bitstreams: Path | None
    ) -> None:
        self.project = project
        self.board = board
        self.mapping = mapping
        self.types = types
        self.bitstreams = bitstreams
        self.executor: Executor | None = None
        self._resources = {
            (resource.group, resource.name): resource for resource in project.configuration.resources
        }
        self._nodes: dict[str, Node] = {}

    def source(self, group: str, name: str) -> Source:
        """Return the end of a topic, service or timer that makes a callback ready."""
        resource = self._resource(group, name)
        match resource.type:
            case "rossub" if resource.hardware_mapped:
                return HmtSource(self.board, self._hardware_topic(resource), resource.fifo)
            case "rossub":
                return SubscriptionSource(
                    self.board,
                    self._node(resource),
                    self.types.message(_required(resource.interface)),
                    _required(resource.ros_name),
                    in_hardware=self._in_hardware(resource),
                )
            case "rossrvs":
                return ServiceSource(
                    self.board,
                    self._node(resource),
                    self.types.service(_required(resource.interface)),
                    _required(resource.ros_name),
                )
            case "rostmr":
                return TimerSource(self.board, _required(resource.number) * 1_000_000)
        raise UsageError(
            f"resource {name!r} of group {group!r} is a {resource.type}: it makes no callback ready."
        )

    def writer(self, group: str, name: str) -> MessageWriter:
        """Return the publisher of that name."""
        resource = self._resource(group, name)
        if resource.type != "rospub":
            raise UsageError(f"resource {name!r} of group {group!r} is a {resource.type}, not a rospub.")
        if resource.hardware_mapped:
            return HmtWriter(self._hardware_topic(resource))
        return self.board.writer(
            self._node(resource),
            self.types.message(_required(resource.interface)),
            _required(resource.ros_name),
        )

    def spin(self, executor: Executor) -> None:
        """Start the gateways and the executor's workers; it is the one that the board reports on."""
        for gateway in self.project.configuration.gateways:
            self.board.add_gateway(
                gateway.name,
                resolve(gateway.hw_topic, "/", gateway.name),
                resolve(gateway.sw_topic, "/", gateway.name),
                self.types.message(gateway.type),
            )
        self.executor = executor
        executor.spin()

    def close(self) -> None:
        """Take the nodes out of the graph."""
        for node in self._nodes.values():
            node.close()

    def _resource(self, group: str, name: str) -> Resource:
        try:
            return self._resources[group, name]
        except KeyError:
            known = ", ".join(f"{group}.{name}" for group, name in self._resources)
            raise UsageError(
                f"{self.project.configuration.path} has no resource {name!r} in a group {group!r}. "
                f"It has {known}."
            ) from None

    def _in_hardware(self, resource: Resource) -> bool:
        """Tell whether a callback that uses the resource may run in a slot."""
        return any(
            self.mapping.callbacks[thread.name].slots
            for thread in self.project.configuration.threads
            if resource.group in thread.resource_groups
        )

    def _hardware_topic(self, resource: Resource) -> HardwareTopic:
        return self.board.hardware_topic(
            topic_name(resource), self.types.message(_required(resource.interface))
        )

    def _node(self, resource: Resource) -> Node:
        name = _required(resource.node)
        if name not in self._nodes:
            namespace, _, base = name.rpartition("/")
            self._nodes[name] = self.board.context.node(base, namespace or "/")
        return self._nodes[name]


def _required(value: T | None) -> T:
    """Return what the grammar of build.cfg guarantees for this type of resource."""
    assert value is not None
    return value
