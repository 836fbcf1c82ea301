"""The parameters of a node and the services through which others see and set them."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.qos import QosProfile
from reconros_zenoh.ros.stamp import set_stamp
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from reconros_zenoh.rmw.ends import NodeEnds
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.type_registry import TypeRegistry

_EVENTS = QosProfile(depth=1000)
"""rmw_qos_profile_parameter_events: reliable, volatile, keep the last 1000."""

Value: TypeAlias = bool | int | float | str | bytes | list[bool] | list[int] | list[float] | list[str]

# By type: the number and the field of rcl_interfaces/msg/ParameterValue.
_SCALARS = {
    bool: (1, "bool_value"),
    int: (2, "integer_value"),
    float: (3, "double_value"),
    str: (4, "string_value"),
    bytes: (5, "byte_array_value"),
}
_LISTS = {
    bool: (6, "bool_array_value"),
    int: (7, "integer_array_value"),
    float: (8, "double_array_value"),
    str: (9, "string_array_value"),
}
_FIELDS = dict((*_SCALARS.values(), *_LISTS.values()))


@dataclass(slots=True)
class _Parameter:
    kind: tuple[int, str]  # number and field of the type that it was declared with
    value: Value
    description: str
    on_set: Callable[[Any], None] | None


class Parameters:
    """The parameters of one node, served under `<node>/get_parameters` and its five sisters.

    A parameter is declared first and keeps its type. Everything may be called from any thread. What is
    declared or set is published on /parameter_events, also when the value is the one that it was.
    """

    def __init__(self, node: NodeEnds, types: TypeRegistry) -> None:
        self._parameters: dict[str, _Parameter] = {}
        self._lock = threading.RLock()
        self._is_changing = False
        self._value_type = types.message("rcl_interfaces/msg/ParameterValue")
        self._descriptor_type = types.message("rcl_interfaces/msg/ParameterDescriptor")
        self._result_type = types.message("rcl_interfaces/msg/SetParametersResult")
        self._parameter_type = types.message("rcl_interfaces/msg/Parameter")
        self._event_type = types.message("rcl_interfaces/msg/ParameterEvent")
        self._node = node
        self._events = node.publisher(self._event_type, "/parameter_events", _EVENTS)
        services: dict[str, Callable[[Any, Any], None]] = {
            "DescribeParameters": self._describe,
            "GetParameters": self._get,
            "GetParameterTypes": self._types,
            "ListParameters": self._list,
            "SetParameters": self._set,
            "SetParametersAtomically": self._set_together,
        }
        for name, answer in services.items():
            service = types.service(f"rcl_interfaces/srv/{name}")

            def respond(received: Received, service: Any = service, answer: Any = answer) -> None:
                response = zero_message(service.response)
                answer(received.message, response)
                assert received.responder is not None
                received.responder.respond_encoded(service.response.encode(response))

            snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name)
            node.service(service, f"~/{snake[1:]}", respond)

    def declare(
        self, name: str, value: Value, on_set: Callable[[Any], None] | None = None, description: str = ""
    ) -> None:
        """Declare a parameter with its first value.

        `on_set` is called with each new value before it is taken over; its UsageError refuses the value, and
        any other exception that it raises becomes one. It cannot declare or set parameters itself, which
        raises one.
        """
        if not name or not isinstance(name, str):
            raise UsageError(f"{name!r} is no name of a parameter. Give a str that is not empty.")
        kind = _kind(name, value)
        with self._changing():
            if name in self._parameters:
                raise UsageError(f"parameter {name!r} is declared already.")
            self._parameters[name] = _Parameter(kind, value, description, on_set)
            event = self._event([name], [])
        self._events.publish(event)

    def get(self, name: str) -> Any:
        """Return the value of a declared parameter."""
        return self._declared(name).value

    def set(self, name: str, value: Value) -> None:
        """Give a declared parameter a new value; raise UsageError when it is refused."""
        with self._changing():
            self._check(name, value)
            self._parameters[name].value = value
            event = self._event([], [name])
        self._events.publish(event)

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Keep others from changing parameters; raise UsageError within `on_set`, as rclcpp does."""
        with self._lock:
            if self._is_changing:
                raise UsageError("on_set cannot declare or set a parameter. Do it when on_set has returned.")
            self._is_changing = True
            try:
                yield
            finally:
                self._is_changing = False

    def _check(self, name: str, value: Value) -> None:
        parameter = self._declared(name)
        # An empty list is one of any type: which one a sender takes it for says nothing. Deviation: ROS 2
        # refuses one of another type.
        is_empty_list = value == [] and isinstance(parameter.value, list)
        if not is_empty_list and _kind(name, value) != parameter.kind:
            raise UsageError(
                f"parameter {name!r} is {type(parameter.value).__name__}, not {type(value).__name__}."
            )
        if parameter.on_set is not None:
            try:
                parameter.on_set(value)
            except UsageError:
                raise
            except Exception as error:
                raise UsageError(f"on_set of parameter {name!r} failed: {error!r}.") from error

    def _declared(self, name: str) -> _Parameter:
        if name not in self._parameters:
            raise UsageError(f"parameter {name!r} is not declared; there are {', '.join(self._parameters)}.")
        return self._parameters[name]

    def _message(self, name: str) -> Any:
        """Return the value as it is sent."""
        message = zero_message(self._value_type)
        value: Any = self._parameters[name].value
        message.type, field = self._parameters[name].kind
        empty = getattr(message, field)
        if isinstance(empty, np.ndarray):
            value = np.array(list(value), empty.dtype)
        setattr(message, field, value)
        return message

    def _asked(self, request: Any) -> list[str]:
        """Return the names in the request, none if one is not declared, as rclpy answers."""
        return request.names if self._parameters.keys() >= set(request.names) else []

    def _describe(self, request: Any, response: Any) -> None:
        for name in self._asked(request):
            descriptor = zero_message(self._descriptor_type)
            descriptor.name, descriptor.type = name, self._parameters[name].kind[0]
            descriptor.description = self._parameters[name].description
            response.descriptors.append(descriptor)

    def _get(self, request: Any, response: Any) -> None:
        response.values = [self._message(name) for name in self._asked(request)]

    def _types(self, request: Any, response: Any) -> None:
        kinds = [self._parameters[name].kind[0] for name in self._asked(request)]
        response.types = np.array(kinds, np.uint8)

    def _list(self, request: Any, response: Any) -> None:
        # Another thread may declare one meanwhile.
        names = [name for name in list(self._parameters) if _is_listed(name, request.prefixes, request.depth)]
        response.result.names = names
        parents = dict.fromkeys(name.rpartition(".")[0] for name in names)
        response.result.prefixes = [parent for parent in parents if parent]

    def _set(self, request: Any, response: Any) -> None:
        response.results = [self._result([parameter]) for parameter in request.parameters]

    def _set_together(self, request: Any, response: Any) -> None:
        response.result = self._result(request.parameters)

    def _result(self, parameters: Sequence[Any]) -> Any:
        """Set all of the parameters or none; return which, and why."""
        result = zero_message(self._result_type)
        try:
            with self._changing():
                values = [(parameter.name, _value(parameter)) for parameter in parameters]
                for name, value in values:
                    self._check(name, value)
                for name, value in values:
                    self._parameters[name].value = value
                event = self._event([], dict(values))
        except UsageError as error:
            result.reason = str(error)
            return result
        # Not with the lock held: who hears it may be in this session and set a parameter in turn.
        if values:
            self._events.publish(event)
        result.successful = True
        return result

    def _event(self, declared: Iterable[str], changed: Iterable[str]) -> Any:
        """Return what is published about these parameters as they are now."""
        event = zero_message(self._event_type)
        set_stamp(event.stamp, self._node.context.clock_ns())
        event.node = self._node.fully_qualified_name
        parameter = self._parameter_type.cls
        event.new_parameters = [parameter(name=name, value=self._message(name)) for name in declared]
        event.changed_parameters = [parameter(name=name, value=self._message(name)) for name in changed]
        return event


def _value(parameter: Any) -> Any:
    """Return the value in an rcl_interfaces/msg/Parameter."""
    if parameter.value.type not in _FIELDS:
        raise UsageError(f"parameter {parameter.name!r} cannot be unset.")
    field = _FIELDS[parameter.value.type]
    value = getattr(parameter.value, field)
    if field == "byte_array_value":
        return bytes(value)
    return value.tolist() if isinstance(value, np.ndarray) else value


def _kind(name: str, value: Value) -> tuple[int, str]:
    """Return number and field of the value's type; raise UsageError for what no parameter can be."""
    elements, known = (value, _LISTS) if isinstance(value, list) else ([value], _SCALARS)
    kinds = {type(element) for element in elements} or {str}
    if len(kinds) == 1 and (kind := kinds.pop()) in known and (kind is not int or _are_int64(elements)):
        return known[kind]
    raise UsageError(
        f"parameter {name!r} cannot be {value!r}: give a bool, int of 64 bits, float, str, bytes or a list."
    )


def _are_int64(numbers: Sequence[Any]) -> bool:
    return all(-(2**63) <= number < 2**63 for number in numbers)


def _is_listed(name: str, prefixes: Sequence[str], depth: int) -> bool:
    """Tell whether the name is asked for: one of the prefixes or below it, so many levels deep (0: all)."""
    if not prefixes:
        return not depth or name.count(".") < depth
    return any(
        name == prefix
        or (name.startswith(f"{prefix}.") and (not depth or name.count(".", len(prefix) + 1) < depth))
        for prefix in prefixes
    )
