"""A ReconROS project on a board: its resources as endpoints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from reconros_zenoh.board.actions import ActionClientSource, ActionSource
from reconros_zenoh.board.additions import check_timing
from reconros_zenoh.board.clients import ClientSource
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.hmt import HmtSource, HmtWriter
from reconros_zenoh.board.os_resources import Condition, Mailbox, Mutex, Semaphore, SharedMemory
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource, TimerSource
from reconros_zenoh.board.stack_node import StackNode
from reconros_zenoh.errors import UsageError
from reconros_zenoh.project.communication import declared_type, endpoint_name, gateway_pair
from reconros_zenoh.project.gateway_slots import gateway_slots
from reconros_zenoh.rmw.parameters import Parameters

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareCallback
    from reconros_zenoh.board.hmt import HardwareTopic
    from reconros_zenoh.board.software import SoftwareCallback
    from reconros_zenoh.board.sources import Source
    from reconros_zenoh.board.timing import Timing
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import ProjectMapping
    from reconros_zenoh.project.resource_groups import Resource
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.qos import QosProfile


T = TypeVar("T")


class Application:
    """What main.py of a project works with: the board, the mapping, and the resources of build.cfg by name.

    `bitstreams` is the folder of the partial bitstreams, None to hold them in memory only.
    """

    def __init__(
        self,
        project: Project,
        board: Board,
        mapping: ProjectMapping,
        bitstreams: Path | None,
    ) -> None:
        self.project = project
        self.board = board
        self.mapping = mapping
        self.types = project.types()
        self.bitstreams = bitstreams
        self.executor: Executor | None = None
        self._mapped: Executor | None = None
        self._resources = {
            (resource.group, resource.name): resource for resource in project.configuration.resources
        }
        self._nodes: dict[str, Node] = {}
        self._made: dict[tuple[str, str], object] = {}

    def source(self, group: str, name: str, qos: QosProfile | None = None) -> Source:
        """Return the end of a topic, service, action or timer that makes a callback ready.

        `qos` is for a topic: without it reliable, volatile, the last 10. For a client it is what `client` or
        `action_client` returns.
        """
        resource = self._resource(group, name)
        if resource.type != "rossub" or resource.hardware_mapped:
            _refuse_qos(resource, qos)
        match resource.type:
            case "rossub":
                return self._subscription(resource, qos)
            case "rossrvs":
                return ServiceSource(self.board, *self._end(resource, self.types.service))
            case "rossrvc":
                return self.client(group, name)
            case "rosactions":
                return ActionSource(self.board, *self._end(resource, self.types.action))
            case "rosactionc":
                return self.action_client(group, name)
            case "rostmr":
                return TimerSource(self.board, _required(resource.number) * 1_000_000)
        raise UsageError(
            f"resource {name!r} of group {group!r} is a {resource.type}: it makes no callback ready."
        )

    def _subscription(self, resource: Resource, qos: QosProfile | None) -> Source:
        if resource.hardware_mapped:
            return HmtSource(self.board, self._hardware_topic(resource), resource.fifo)
        end = self._end(resource, self.types.message)
        return SubscriptionSource(self.board, *end, qos)

    def client(self, group: str, name: str) -> ClientSource:
        """Return the service client of that name, the same one each time."""
        return self._shared(
            group, name, "rossrvc", lambda r: ClientSource(self.board, *self._end(r, self.types.service))
        )

    def action_client(self, group: str, name: str) -> ActionClientSource:
        """Return the action client of that name, the same one each time."""
        return self._shared(
            group,
            name,
            "rosactionc",
            lambda r: ActionClientSource(self.board, *self._end(r, self.types.action)),
        )

    def writer(self, group: str, name: str, qos: QosProfile | None = None) -> MessageWriter:
        """Return the publisher of that name; without `qos` reliable, volatile, the last 10."""
        resource = self._resource_of(group, name, "rospub")
        if resource.hardware_mapped:
            _refuse_qos(resource, qos)
            return HmtWriter(self._hardware_topic(resource))
        return self.board.writer(*self._end(resource, self.types.message), qos)

    def mbox(self, group: str, name: str) -> Mailbox:
        """Return the mailbox of that name, the same one each time."""
        return self._shared(
            group, name, "mbox", lambda r: Mailbox(self.board.environment, _required(r.number))
        )

    def mutex(self, group: str, name: str) -> Mutex:
        """Return the mutex of that name, the same one each time."""
        return self._shared(group, name, "mutex", lambda _: Mutex(self.board.environment))

    def cond(self, group: str, name: str) -> Condition:
        """Return the condition of that name, the same one each time."""
        return self._shared(
            group, name, "cond", lambda r: Condition(self.board.environment, self.mutex(group, r.args[0]))
        )

    def sem(self, group: str, name: str) -> Semaphore:
        """Return the semaphore of that name, the same one each time."""
        return self._shared(
            group, name, "sem", lambda r: Semaphore(self.board.environment, _required(r.number))
        )

    def mem(self, group: str, name: str) -> SharedMemory:
        """Return the memory of that name, the same one each time, zero at first."""

        def allocate(resource: Resource) -> SharedMemory:
            words = np.zeros(_required(resource.number), np.uint32)
            return SharedMemory(self.board.memory.map(words.view(np.uint8)), words)

        return self._shared(group, name, "mem", allocate)

    def parameters(self, group: str, name: str) -> Parameters:
        """Return the parameters of the node (a rosnode) of that name, the same ones each time."""

        def serve(resource: Resource) -> Parameters:
            node = self._node(_required(resource.ros_name))
            return Parameters(StackNode(self.board, node, "~"), self.types)

        return self._shared(group, name, "rosnode", serve)

    def register(
        self,
        name: str,
        resource: str,
        *,
        software: SoftwareCallback | None = None,
        hardware: HardwareCallback | None = None,
        check: Callable[[Any], None] | None = None,
        software_timing: Timing | None = None,
        hardware_timing: Timing | None = None,
        limit_ms: float | None = None,
        qos: QosProfile | None = None,
    ) -> None:
        """Let the callback `name` of build.cfg run where the mapping wants it, whenever `resource` is ready.

        That is a subscription, service, action, client or timer of its resource groups; `check` raises
        BadMessageError for bad messages; the timings say how long it takes where the profile's table does
        not; `limit_ms` is the longest that a call may take; `qos` is as in `source`. The executor is the one
        that the mapping describes; `spin` starts it.
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
                f"callback {name!r} has no resource {resource!r} in its groups: "
                f"{', '.join(groups) or 'none'}. Correct the name, or `ResourceGroup` of "
                f"[ReconosThread@{name}] in build.cfg."
            )
        for side, function, timing in (
            ("software", software, software_timing),
            ("hardware", hardware, hardware_timing),
        ):
            check_timing(name, timing)  # also where this mapping does not need it
            if function is None and timing is not None:
                raise UsageError(
                    f"callback {name!r} has {side}_timing, but no `{side}` that takes it. Give both or none."
                )
        source = self.source(group, resource, qos)
        kind = _required(source.kind)
        executor = self._mapped = self._mapped or self._mapped_executor()
        place = self.mapping.callbacks[name]
        if place.software:
            if software is None:
                raise UsageError(
                    f"callback {name!r} is mapped to software, but no `software` is given. Give it, or "
                    "map the callback to slots."
                )
            executor.add_sw_callback(name, kind, source, software, check, software_timing, limit_ms)
        if place.slots:
            if hardware is None:
                raise UsageError(
                    f"callback {name!r} is mapped to hardware, but no `hardware` is given. Give it, or "
                    "map the callback to software."
                )
            executor.add_hw_callback(
                name, place.slots, kind, source, hardware, check, hardware_timing, limit_ms
            )

    def spin(self, executor: Executor | None = None) -> None:
        """Start the gateways and the workers of an executor of one's own or of the one `register` has filled.

        It is the one that the board reports on. Raises UsageError the second time.
        """
        if self.executor is not None:
            raise UsageError(
                "the executor spins already. Call app.spin() once, when all callbacks are added."
            )
        self.executor = executor or self._mapped
        if self.executor is None:
            raise UsageError("app.spin() without a callback. Call app.register(...) first.")
        configuration = self.project.configuration
        mapped = {name: callback.slots for name, callback in self.mapping.callbacks.items()}
        slots = gateway_slots(configuration, mapped)
        for gateway in configuration.gateways:
            pair = gateway_pair(configuration.path, gateway)
            message_type = declared_type(configuration.path, gateway, self.types.message)
            self.board.add_gateway(
                gateway.name, pair.hmt, pair.smt, message_type, slots[gateway.name], gateway.qos
            )
        self.executor.spin()

    def close(self) -> None:
        """Take the nodes out of the graph."""
        for node in self._nodes.values():
            node.close()

    def _end(self, end: Resource, find: Callable[[str], T]) -> tuple[Node, T, str]:
        """Return node, type and name, as written, of an end; raise FileError for what cannot be."""
        path = self.project.configuration.path
        endpoint_name(path, end)
        return self._node(_required(end.node)), declared_type(path, end, find), _required(end.ros_name)

    def _shared(self, group: str, name: str, kind: str, make: Callable[[Resource], T]) -> T:
        if (group, name) not in self._made:
            self._made[group, name] = make(self._resource_of(group, name, kind))
        return cast("T", self._made[group, name])

    def _resource_of(self, group: str, name: str, kind: str) -> Resource:
        resource = self._resource(group, name)
        if resource.type != kind:
            raise UsageError(f"resource {name!r} of group {group!r} is a {resource.type}, not a {kind}.")
        return resource

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

    def _hardware_topic(self, resource: Resource) -> HardwareTopic:
        self._node(_required(resource.node))  # of a stream nothing is in the network, but its node is
        path = self.project.configuration.path
        return self.board.hardware_topic(
            endpoint_name(path, resource), declared_type(path, resource, self.types.message)
        )

    def _node(self, name: str) -> Node:
        if name not in self._nodes:
            namespace, _, base = name.rpartition("/")
            self._nodes[name] = self.board.context.node(base, namespace or "/")
        return self._nodes[name]


def _refuse_qos(resource: Resource, qos: QosProfile | None) -> None:
    if qos is not None:
        kind = "hardware-mapped topic" if resource.hardware_mapped else resource.type
        raise UsageError(
            f"resource {resource.name!r} of group {resource.group!r} is a {kind}: its QoS is fixed."
        )


def _required(value: T | None) -> T:
    """Return what the grammar of build.cfg guarantees for this type of resource."""
    assert value is not None
    return value
