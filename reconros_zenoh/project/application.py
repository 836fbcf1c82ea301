"""A ReconROS project on a board: its resources as endpoints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from reconros_zenoh.board.endpoints import ServiceSource, SubscriptionSource, TimerSource, TopicWriter
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.errors import UsageError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareCallback, SoftwareCallback
    from reconros_zenoh.board.endpoints import Source
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import Mapping
    from reconros_zenoh.project.resource_groups import Resource
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.types import TypeRegistry


T = TypeVar("T")
_KINDS = {
    "rostmr": CallbackKind.TMR,
    "rossub": CallbackKind.SUB,
    "rossrvs": CallbackKind.SRV,
    "rosactions": CallbackKind.SRV,
    "rossrvc": CallbackKind.CLT,
    "rosactionc": CallbackKind.CLT,
}


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
        self._mapped: Executor | None = None
        self._resources = {
            (resource.group, resource.name): resource for resource in project.configuration.resources
        }
        self._nodes: dict[str, Node] = {}

    def source(self, group: str, name: str) -> Source:
        """Return the end of a topic, service or timer that makes a callback ready."""
        resource = self._resource(group, name)
        match resource.type:
            case "rossub":
                return SubscriptionSource(
                    self.board,
                    self._node(resource),
                    self.types.message(_required(resource.interface)),
                    _required(resource.ros_name),
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

    def writer(self, group: str, name: str) -> TopicWriter:
        """Return the publisher of that name."""
        resource = self._resource(group, name)
        if resource.type != "rospub":
            raise UsageError(f"resource {name!r} of group {group!r} is a {resource.type}, not a rospub.")
        return TopicWriter(
            self.board,
            self._node(resource),
            self.types.message(_required(resource.interface)),
            _required(resource.ros_name),
        )

    def register(
        self,
        name: str,
        resource: str,
        *,
        software: SoftwareCallback | None = None,
        hardware: HardwareCallback | None = None,
        check: Callable[[Any], None] | None = None,
    ) -> None:
        """Let the callback `name` of build.cfg run where the mapping wants it, whenever `resource` is ready.

        That is a subscription, service or timer of its resource groups; `check` raises BadMessageError for
        bad messages. The executor is the one that the mapping describes; `spin` starts it.
        """
        threads = {thread.name: thread for thread in self.project.configuration.threads}
        if name not in threads:
            raise UsageError(
                f"build.cfg has no callback {name!r}. Add `[ReconosThread@{name}]`, or give one of "
                f"{', '.join(threads)}."
            )
        groups = threads[name].resource_groups
        group = next((group for group in groups if (group, resource) in self._resources), None)
        if group is None:
            raise UsageError(
                f"callback {name!r} has no resource {resource!r} in its groups, {', '.join(groups)}."
            )
        source = self.source(group, resource)
        kind = _KINDS[self._resources[group, resource].type]
        executor = self._mapped = self._mapped or self._mapped_executor()
        place = self.mapping.callbacks[name]
        if place.software:
            if software is None:
                raise UsageError(
                    f"callback {name!r} is mapped to software, but no `software` is given. Give it, or "
                    "map the callback to reconfigurable slots."
                )
            executor.add_sw_callback(name, kind, source, software, check)
        if place.slots:
            if hardware is None:
                raise UsageError(
                    f"callback {name!r} is mapped to hardware, but no `hardware` is given. Give it, or "
                    "map the callback to software."
                )
            executor.add_hw_callback(name, place.slots, kind, source, hardware, check)

    def spin(self, executor: Executor | None = None) -> None:
        """Start the workers of an executor of one's own or of the one that `register` has filled.

        It is the one that the board reports on.
        """
        self.executor = executor or self._mapped
        if self.executor is None:
            raise UsageError("app.spin() without a callback. Call app.register(...) first.")
        self.executor.spin()

    def close(self) -> None:
        """Take the nodes out of the graph."""
        for node in self._nodes.values():
            node.close()

    def _mapped_executor(self) -> Executor:
        mapping = self.mapping
        return Executor(
            self.board, mapping.software_workers, mapping.hardware_workers, self.bitstreams, mapping.executor
        )

    def _resource(self, group: str, name: str) -> Resource:
        try:
            return self._resources[group, name]
        except KeyError:
            known = ", ".join(f"{group}.{name}" for group, name in self._resources)
            raise UsageError(
                f"{self.project.configuration.path} has no resource {name!r} in a group {group!r}. "
                f"It has {known}."
            ) from None

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
