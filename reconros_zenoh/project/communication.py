"""Whether the topics of a project can be mapped as its files say, before anything starts."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, TypeVar

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.gateway.filters import Pair, conflict
from reconros_zenoh.project.build_cfg import RosGateway
from reconros_zenoh.project.gateway_slots import gateway_slots
from reconros_zenoh.project.mapping_file import built_for
from reconros_zenoh.ros.message_size import smallest_bytes
from reconros_zenoh.ros.names import resolve

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from reconros_zenoh.project.build_cfg import BuildConfiguration
    from reconros_zenoh.project.mapping_file import CallbackMapping
    from reconros_zenoh.project.resource_groups import Resource
    from reconros_zenoh.ros.type_registry import TypeRegistry

T = TypeVar("T")

_ENDS = {"rossub": "subscriber", "rospub": "publisher"}


def endpoint_name(path: Path, resource: Resource) -> str:
    """Return the absolute name of the topic, service or action of an end in the project file `path`.

    Raise FileError for a name that ROS 2 does not allow.
    """
    assert resource.node is not None
    assert resource.ros_name is not None
    namespace, _, node = resource.node.rpartition("/")
    return _resolved(path, resource.line, resource.ros_name, namespace or "/", node)


def gateway_pair(path: Path, gateway: RosGateway) -> Pair:
    """Return the absolute names of the topics of a gateway; raise FileError as `endpoint_name`."""
    hmt, smt = (
        _resolved(path, gateway.line, topic, "/", gateway.name)
        for topic in (gateway.hw_topic, gateway.sw_topic)
    )
    return Pair(hmt, smt)


def declared_type(path: Path, end: Resource | RosGateway, find: Callable[[str], T]) -> T:
    """Return what `find` finds of the type of an end or gateway; raise FileError where nobody defines it."""
    name = end.type if isinstance(end, RosGateway) else end.interface
    assert name is not None
    try:
        return find(name)
    except UsageError as error:
        raise FileError(path, end.line, f"{end.name}: {error}") from error


def check_topics(configuration: BuildConfiguration) -> BuildConfiguration:
    """Return the configuration, with a warning for each gateway to a stream that has no end.

    Raise FileError at the line of the first topic or gateway that cannot be mapped as declared.
    """
    hardware: defaultdict[str, list[Resource]] = defaultdict(list)
    software: defaultdict[str, list[Resource]] = defaultdict(list)
    for resource in configuration.resources:
        if resource.type in _ENDS:
            name = endpoint_name(configuration.path, resource)
            (hardware if resource.hardware_mapped else software)[name].append(resource)
    pairs = _checked_gateways(configuration, hardware, software)
    bridged = {pair.hmt: pair.smt for pair in pairs}
    for topic, ends in hardware.items():
        _check_ends(configuration, topic, ends)
        for end in software[topic]:
            if bridged.get(topic) != topic:
                raise FileError(
                    configuration.path,
                    end.line,
                    f"{topic} is mapped to hardware (line {ends[0].line}), and has a software-mapped "
                    f"{_ENDS[end.type]} but no gateway to it.",
                    f"Declare a `[ROSGateway@name]` with `HWTopic = {topic}` and `SWTopic = {topic}`.",
                )
    unused = [
        f"{configuration.path}:{gateway.line}: the gateway {gateway.name} has no use, because nobody has a "
        f"hardware-mapped end of {pair.hmt}. There are ends of: {', '.join(hardware) or 'none'}."
        for gateway, pair in zip(configuration.gateways, pairs, strict=True)
        if pair.hmt not in hardware
    ]
    return replace(configuration, warnings=(*configuration.warnings, *unused))


def check_types(configuration: BuildConfiguration, types: TypeRegistry) -> None:
    """Raise FileError at the line of the first end or gateway of a type that nobody defines.

    So it does for an end with a name that ROS 2 does not allow.
    """
    find = {"msg": types.message, "srv": types.service, "action": types.action}
    for end in configuration.resources:
        if end.node is not None and end.interface is not None:
            endpoint_name(configuration.path, end)
            declared_type(configuration.path, end, find[end.interface.split("/")[1]])
    for gateway in configuration.gateways:
        declared_type(configuration.path, gateway, types.message)


def check_fifos(configuration: BuildConfiguration, types: Callable[[], TypeRegistry]) -> None:
    """Raise FileError at the line of the first end that no message of its type fits, or of an unknown type.

    `types` is called if there is an end that declares the bytes of its messages.
    """
    for end in configuration.resources:
        if end.fifo.message_bytes is None:
            continue
        message_type = declared_type(configuration.path, end, types().message)
        smallest = smallest_bytes(message_type)
        if end.fifo.message_bytes < smallest:
            raise FileError(
                configuration.path,
                end.line,
                f"message_bytes of {end.name} is {end.fifo.message_bytes}, but no message of the type "
                f"{end.interface} has fewer than {smallest} bytes.",
                "Raise its message_bytes.",
            )


def check_places(configuration: BuildConfiguration, callbacks: Mapping[str, CallbackMapping]) -> None:
    """Raise FileError at the line of what cannot be where it would be.

    That is a callback that may run in software and has slots but no SwSource, a hardware-mapped end of one
    that may run there, a slot that is not reconfigurable and would have to hold two callbacks, and a gateway
    without a slot of its own.
    """
    for slot in configuration.slots:
        tenants = [name for name, callback in callbacks.items() if slot.id in callback.slots]
        if len(tenants) > 1 and not slot.reconfigurable:
            raise FileError(
                configuration.path,
                slot.line,
                f"{slot.name} (Id {slot.id}) is not reconfigurable, but {' and '.join(tenants)} are mapped "
                "to it.",
                "Map one callback to it, or write `Reconfigurable = true`.",
            )
    built = built_for(configuration)
    for thread in configuration.threads:
        if not callbacks[thread.name].software:
            continue
        if built[thread.name] and not thread.software:
            raise FileError(
                configuration.path,
                thread.line,
                f"The callback {thread.name} is mapped to software, but has no SwSource.",
                "Map it to slots only, or name the source of its software version.",
            )
        for resource in configuration.resources:
            if resource.hardware_mapped and resource.group in thread.resource_groups:
                raise FileError(
                    configuration.path,
                    resource.line,
                    f"The callback {thread.name} is mapped to software, but {resource.name} is a "
                    f"{_ENDS[resource.type]} of a hardware-mapped topic.",
                    "Map the callback to slots only, or the topic to software, with a gateway between.",
                )
    gateway_slots(configuration, {name: callback.slots for name, callback in callbacks.items()})


def _check_ends(configuration: BuildConfiguration, topic: str, ends: list[Resource]) -> None:
    for end in ends:
        if end.interface != ends[0].interface:
            raise FileError(
                configuration.path,
                end.line,
                f"{topic} has the type {end.interface} here and {ends[0].interface} in line {ends[0].line}.",
                "A topic has one type.",
            )
    publishers = (end for end in ends if end.type == "rospub")
    subscribers = (end for end in ends if end.type == "rossub")
    for publisher, subscriber in product(publishers, subscribers):
        held, sent = subscriber.fifo.message_bytes, publisher.fifo.message_bytes
        if held is not None and sent is not None and sent > held:
            raise FileError(
                configuration.path,
                subscriber.line,
                f"The FIFO of {subscriber.name} holds messages of {held} bytes, but {publisher.name} (line "
                f"{publisher.line}) publishes up to {sent} on {topic}.",
                "Raise its message_bytes.",
            )


def _resolved(path: Path, line: int, topic: str, namespace: str, node: str) -> str:
    try:
        return resolve(topic, namespace, node)
    except UsageError as error:
        raise FileError(path, line, str(error)) from None


def _checked_gateways(
    configuration: BuildConfiguration,
    hardware: Mapping[str, list[Resource]],
    software: Mapping[str, list[Resource]],
) -> list[Pair]:
    """Return the topics of all gateways."""
    pairs: list[Pair] = []
    for gateway in configuration.gateways:
        pair = gateway_pair(configuration.path, gateway)
        taken = conflict(pair, pairs)
        if taken is not None:
            raise FileError(
                configuration.path,
                gateway.line,
                f"{taken} is mapped twice: it has a gateway already.",
                f"Take [ROSGateway@{gateway.name}] away.",
            )
        pairs.append(pair)
        for end in (*hardware.get(pair.hmt, ()), *software.get(pair.smt, ())):
            if end.interface != gateway.type:
                raise FileError(
                    configuration.path,
                    gateway.line,
                    f"The gateway {gateway.name} has the type {gateway.type}, but {end.name} in line "
                    f"{end.line} has {end.interface}.",
                    "Write the type of the topics.",
                )
    return pairs
