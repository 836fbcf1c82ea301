"""The message, service and action types that a process knows, by their names."""

from __future__ import annotations

import difflib
from functools import cached_property
from typing import TYPE_CHECKING

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, TypesysError, get_typestore

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.ros.definitions import (
    action_definitions,
    message_definition,
    service_definitions,
)
from reconros_zenoh.ros.names import dds_type_name
from reconros_zenoh.ros.standard import standard_interfaces
from reconros_zenoh.ros.types import ActionType, MessageType, ServiceType

if TYPE_CHECKING:
    from collections.abc import Collection

    from rosbags.interfaces.typing import FieldDesc, Typesdict
    from rosbags.typesys.store import Typestore

_DEEPEST = 19
"""How deep messages are in messages: with a list of strings these are 20 nested loops, Python's limit."""


class TypeRegistry:
    """The types of the standard packages of ROS 2 Jazzy, and the types that are added.

    The first type that is asked for takes as long as rosbags needs to load those of Jazzy. To be used from
    one thread; the types it returns may be used from all.
    """

    def __init__(self) -> None:
        self._messages: dict[str, MessageType] = {}
        self._services: dict[str, ServiceType] = {}
        self._actions: dict[str, ActionType] = {}
        self._service_names: set[str] = set()
        self._action_names: set[str] = set()

    def message(self, name: str) -> MessageType:
        """Return the message type `name`: `std_msgs/msg/UInt32`, `std_msgs/UInt32` or `std_msgs/U_Int32`.

        The last is how ReconROS spells it. Raises UsageError when the type, or a type in it, is not known.
        """
        known = self._store.fielddefs.keys() - self._service_names - self._action_names
        full_name = _find(name, "msg", known | _standard("msg"))
        if full_name not in self._messages:
            self._add_standard(full_name)
            self._check_fields(full_name, ())
            self._messages[full_name] = MessageType(self._store, full_name)
        return self._messages[full_name]

    def service(self, name: str) -> ServiceType:
        """Return the service type `name`: `std_srvs/srv/SetBool`, `std_srvs/SetBool` or `std_srvs/Set_Bool`.

        Raises UsageError when the type, or a type in it, is not known.
        """
        full_name = _find(name, "srv", self._service_names | _standard("srv"))
        if full_name not in self._services:
            self._add_standard(full_name)
            request = self.message(f"{full_name}_Request")
            response = self.message(f"{full_name}_Response")
            self._services[full_name] = ServiceType(
                full_name, dds_type_name(full_name), self._store.hash_rihs01(full_name), request, response
            )
        return self._services[full_name]

    def action(self, name: str) -> ActionType:
        """Return the action type `name`: `tf2_msgs/action/LookupTransform` or `tf2_msgs/Lookup_Transform`.

        Raises UsageError when the type, or a type in it, is not known.
        """
        full_name = _find(name, "action", self._action_names | _standard("action"))
        if full_name not in self._actions:
            self._add_standard(full_name)
            self._actions[full_name] = ActionType(
                full_name,
                self._store.hash_rihs01(full_name),
                goal=self.message(f"{full_name}_Goal"),
                result=self.message(f"{full_name}_Result"),
                feedback=self.message(f"{full_name}_Feedback"),
                send_goal=self.service(f"{full_name}_SendGoal"),
                get_result=self.service(f"{full_name}_GetResult"),
                cancel_goal=self.service("action_msgs/srv/CancelGoal"),
                feedback_message=self.message(f"{full_name}_FeedbackMessage"),
                status=self.message("action_msgs/msg/GoalStatusArray"),
            )
        return self._actions[full_name]

    def add(self, name: str, text: str) -> None:
        """Make the type `name` (`package/kind/Type`) known, whose file of that kind holds `text`.

        Raises FileError (with the type in place of the path) when the text cannot be understood, UsageError
        when the name cannot be used. Types in it may be added later.
        """
        if "/srv/" in name:
            self.add_service(name, text)
        elif "/action/" in name:
            self.add_action(name, text)
        else:
            self.add_message(name, text)

    def add_message(self, name: str, text: str) -> None:
        """Make the message type `name` (`package/msg/Type`) known, whose .msg file holds `text`.

        Raises as `add`.
        """
        self._register(name, message_definition(name, text))

    def add_service(self, name: str, text: str) -> None:
        """Make the service type `name` (`package/srv/Type`) known, whose .srv file holds `text`.

        Raises as `add`.
        """
        self._register(name, service_definitions(name, text))
        self._service_names.add(name)

    def add_action(self, name: str, text: str) -> None:
        """Make the action type `name` (`package/action/Type`) known, whose .action file holds `text`.

        Raises as `add`.
        """
        self._register(name, action_definitions(name, text))
        self._action_names.add(name)
        self._service_names |= {f"{name}_SendGoal", f"{name}_GetResult"}

    @cached_property
    def _store(self) -> Typestore:
        store = get_typestore(Stores.ROS2_JAZZY)
        for name, (constants, fields) in store.fielddefs.items():
            store.fielddefs[name] = (constants, [(field, _char_as_uint8(form)) for field, form in fields])
        return store

    def _add_standard(self, name: str) -> None:
        """Make the type known if it is a standard one that rosbags does not bring and nobody has added."""
        if name in standard_interfaces() and name not in self._store.fielddefs:
            self.add(name, standard_interfaces()[name].read_text(encoding="utf-8"))

    def _register(self, name: str, definitions: Typesdict) -> None:
        try:
            self._store.register(definitions)
        except TypesysError as error:
            raise FileError(name, None, f"cannot be added: {error}", "Rename what conflicts.") from error

    def _check_fields(self, name: str, owners: tuple[str, ...]) -> None:
        for field, form in self._store.fielddefs[name][1]:
            inner = form[1][0] if form[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE} else form
            if inner[0] != Nodetype.NAME:
                continue
            if inner[1] in (*owners, name):
                raise UsageError(f"Field {field!r} of {name} contains {name} itself. Take it out.")
            if len(owners) == _DEEPEST:
                raise UsageError(f"{owners[0]} has more than {_DEEPEST} levels of messages. Take it apart.")
            self._add_standard(inner[1])
            if inner[1] not in self._store.fielddefs:
                raise UsageError(
                    f"Field {field!r} of {name} has the type {inner[1]}, which is not known. "
                    "Correct its name or give its .msg file."
                )
            self._check_fields(inner[1], (*owners, name))


def _standard(kind: str) -> set[str]:
    return {name for name in standard_interfaces() if f"/{kind}/" in name}


def _find(name: str, kind: str, known: Collection[str]) -> str:
    package, _, rest = name.partition("/")
    full_name = name if "/" in rest else f"{package}/{kind}/{rest}"
    if full_name in known:
        return full_name
    folded = _folded(full_name)
    found = [candidate for candidate in known if _folded(candidate) == folded]
    if len(found) == 1:
        return found[0]
    similar = difflib.get_close_matches(full_name, sorted(known), n=3)
    raise UsageError(
        f"The type {name!r} is not known"
        + (f"; similar are {', '.join(similar)}" if similar else "")
        + f". Correct its name, package/{kind}/Type, or give its .{kind} file."
    )


def _folded(name: str) -> tuple[str, str]:
    """Return `name` so that the split words of ReconROS, U_Int32_Multi_Array, make no difference."""
    package_and_kind, _, type_name = name.rpartition("/")
    return package_and_kind, type_name.replace("_", "").lower()


def _char_as_uint8(description: FieldDesc) -> FieldDesc:
    """Return the description of a field with `char` replaced by the `uint8` that rosidl makes of it.

    Both have the same bytes, but rosbags gives `char` a type id of its own and so another RIHS01 hash.
    """
    if description == (Nodetype.BASE, ("char", 0)):
        return (Nodetype.BASE, ("uint8", 0))
    if description[0] == Nodetype.ARRAY or description[0] == Nodetype.SEQUENCE:
        element, size = description[1]
        if element == (Nodetype.BASE, ("char", 0)):
            return (description[0], ((Nodetype.BASE, ("uint8", 0)), size))
    return description
