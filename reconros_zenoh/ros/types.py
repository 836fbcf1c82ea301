"""Message, service and action types: their names, hashes and CDR serialisation, on top of rosbags."""

from __future__ import annotations

import difflib
import reprlib
import struct
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_typestore

from reconros_zenoh.errors import BadMessageError, FileError, UsageError
from reconros_zenoh.ros.definitions import (
    action_definitions,
    char_as_uint8,
    message_definition,
    service_definitions,
)
from reconros_zenoh.ros.field_checks import FieldChecks
from reconros_zenoh.ros.message_arrays import is_unchanging
from reconros_zenoh.ros.names import dds_type_name
from reconros_zenoh.ros.standard import standard_interfaces

if TYPE_CHECKING:
    from collections.abc import Collection

    from rosbags.interfaces.typing import Fielddefs, FieldDesc, Typesdict
    from rosbags.typesys.store import Typestore

_ENCAPSULATION_LENGTH = 4
_COUNT = struct.Struct("<I")
_ENCAPSULATIONS = {  # DDS-XTypes 1.3, Table 60
    0x0000: "CDR big endian",
    0x0001: "CDR little endian",
    0x0002: "PL_CDR big endian",
    0x0003: "PL_CDR little endian",
    0x0006: "CDR2 big endian",
    0x0007: "CDR2 little endian",
    0x0008: "D_CDR2 big endian",
    0x0009: "D_CDR2 little endian",
    0x000A: "PL_CDR2 big endian",
    0x000B: "PL_CDR2 little endian",
}
_LITTLE_ENDIAN = 0x0001

_SPLIT_FROM = 65536
"""Arrays from this size [byte] on are not copied; below, a copy takes less time than a second part."""


class MessageType:
    """A message type that can be sent and received.

    `name` is `package/msg/Type`, `dds_name` and `type_hash` are its name and RIHS01 hash on the wire, `cls`
    is the dataclass of its messages, `fields` the names of its fields with their forms (as rosbags has them).
    Comes from a TypeRegistry; may be used from any thread.
    """

    def __init__(self, store: Typestore, name: str) -> None:
        definition = store.get_msgdef(name)
        self.name = name
        self.dds_name = dds_type_name(name)
        self.type_hash = store.hash_rihs01(name)
        self.cls: type[Any] = definition.cls
        self._store = store
        self._nested: dict[str, MessageType] = {}
        self._size = definition.getsize_cdr
        self._serialize_body = definition.serialize_cdr_le
        self._deserialize_body = definition.deserialize_cdr_le
        self.fields = definition.fields
        self._fields_before = [field for field, _ in definition.fields[:-1]]
        self._last_array = _last_array(definition.fields)
        self._field_checks = FieldChecks(store, name)

    def __repr__(self) -> str:
        return f"MessageType({self.name!r})"

    def nested(self, name: str) -> MessageType:
        """Return the message type `name` of a field of this one."""
        if name not in self._nested:
            self._nested[name] = MessageType(self._store, name)
        return self._nested[name]

    def form(self, path: str) -> FieldDesc:
        """Return the form of a field, `data` or `header.stamp.sec`; raise UsageError for what is none."""
        owner: MessageType | None = self
        for name in path.split("."):
            fields = dict(owner.fields) if owner else {}
            if name not in fields:
                known = f"; there are {', '.join(fields)}" if fields else ""
                raise UsageError(f"{self.name} has no field {path!r}{known}.")
            form = fields[name]
            owner = owner.nested(form[1]) if owner and form[0] == Nodetype.NAME else None
        return form

    def check(self, message: object) -> None:
        """Raise UsageError for what is no message of this type, which may be that of another registry."""
        if type(message) is not self.cls and getattr(message, "__msgtype__", None) != self.name:
            found = getattr(message, "__msgtype__", None)
            raise UsageError(
                f"A message of type {self.name} is wanted, not "
                + (f"one of type {found}." if found else f"{reprlib.repr(message)}.")
            )

    def encode(self, message: Any, *, joined_at_once: bool = False) -> tuple[bytes | memoryview, ...]:
        """Return the parts that joined are `message` as XCDR1 little endian, with its encapsulation.

        A big array in the last field that nobody can change is not copied: the last part is a view of it.
        With `joined_at_once` none is: then it must not change before the parts are joined. Raises UsageError
        for a message of another type, or whose fields do not have their types.
        """
        self.check(message)
        try:
            if self._field_checks.are_some:
                self._field_checks.check(message)
            if self._last_array is not None:
                field, empty = self._last_array
                array = getattr(message, field)
                if _can_be_viewed(array, empty.dtype):
                    others = [getattr(message, other) for other in self._fields_before]
                    # The last thing in the header is the count of the last array, 0 so far.
                    header = self._serialize(self.cls(*others, empty))[: -_COUNT.size]
                    content: bytes | memoryview = memoryview(array).cast("B").toreadonly()
                    if not (joined_at_once or is_unchanging(array)):
                        content = bytes(content)
                    return header + _COUNT.pack(len(array)), content
            return (self._serialize(message),)
        except (AttributeError, TypeError, ValueError, SerdeError, struct.error) as error:
            raise UsageError(
                f"A message of type {self.name} cannot be serialised: {error}. Give every field a value of "
                "its type, and arrays of numbers as one-dimensional numpy arrays of the dtype of the field."
            ) from error

    def decode(self, payload: bytes | memoryview) -> Any:
        """Return the message that `payload` encodes; its arrays of numbers are views of `payload`.

        Raises BadMessageError `truncated` when the bytes end too early or too late, or a string or array
        in them does, and `foreign_encoding` for another encapsulation than CDR little endian and for
        strings that are not UTF-8.
        """
        if len(payload) < _ENCAPSULATION_LENGTH:
            raise BadMessageError(
                "truncated", f"{self.name}: no encapsulation header of 4 bytes in a payload of {len(payload)}"
            )
        encapsulation = payload[0] << 8 | payload[1]
        if encapsulation != _LITTLE_ENDIAN:
            kind = _ENCAPSULATIONS.get(encapsulation, "unknown")
            raise BadMessageError(
                "foreign_encoding",
                f"{self.name}: encapsulation {encapsulation:04x} ({kind}), not 0001 (CDR little endian)",
            )
        body = memoryview(payload)[_ENCAPSULATION_LENGTH:]
        try:
            message, end = self._deserialize_body(body, 0, self.cls, self._store)
        except UnicodeDecodeError as error:
            raise BadMessageError(
                "foreign_encoding", f"{self.name}: a string is not UTF-8: {error}"
            ) from error
        except (SerdeError, ValueError, struct.error) as error:
            raise BadMessageError("truncated", f"{self.name}, {len(payload)} bytes: {error}") from error
        # Some DDS implementations fill the last word of a payload.
        if len(body) > end + -end % 4:
            raise BadMessageError(
                "truncated", f"{self.name}: the message ends after {end} of {len(body)} bytes"
            )
        return message

    def _serialize(self, message: Any) -> bytes:
        data = bytearray(_ENCAPSULATION_LENGTH + self._size(0, message, self._store))
        data[1] = _LITTLE_ENDIAN
        self._serialize_body(memoryview(data)[_ENCAPSULATION_LENGTH:], 0, message, self._store)
        return bytes(data)


@dataclass(frozen=True, slots=True, eq=False)
class ServiceType:
    """A service type: `name` is `package/srv/Type`, `dds_name` and `type_hash` stand on the wire."""

    name: str
    dds_name: str
    type_hash: str
    request: MessageType
    response: MessageType


@dataclass(frozen=True, slots=True, eq=False)
class ActionType:
    """An action type, `package/action/Type`, and what travels between its clients and its server.

    `<action>/_action/send_goal`, `get_result` and `cancel_goal` are services of these types;
    `feedback_message` and `status` are the messages on the topics `<action>/_action/feedback` and `status`.
    """

    name: str
    type_hash: str
    goal: MessageType
    result: MessageType
    feedback: MessageType
    send_goal: ServiceType
    get_result: ServiceType
    cancel_goal: ServiceType
    feedback_message: MessageType
    status: MessageType


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
            store.fielddefs[name] = (constants, [(field, char_as_uint8(form)) for field, form in fields])
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
            self._add_standard(inner[1])
            if inner[1] not in self._store.fielddefs:
                raise UsageError(
                    f"Field {field!r} of {name} has the type {inner[1]}, which is not known. "
                    "Correct its name or give its .msg file."
                )
            self._check_fields(inner[1], (*owners, name))


def _last_array(fields: Fielddefs) -> tuple[str, np.ndarray[Any, Any]] | None:
    """Return the last field, and an empty array of its dtype, if it is an unbounded array of small numbers.

    Numbers of more than 4 bytes may need padding between their count and the first of them.
    """
    field, form = fields[-1]
    if form[0] != Nodetype.SEQUENCE or form[1][1] != 0 or form[1][0][0] != Nodetype.BASE:
        return None
    base = form[1][0][1][0]
    if base == "string":
        return None
    empty = np.empty(0, np.dtype(base).newbyteorder("<"))
    return (field, empty) if empty.itemsize <= _COUNT.size else None


def _can_be_viewed(array: Any, dtype: np.dtype[Any]) -> bool:
    return (
        isinstance(array, np.ndarray)
        and array.nbytes >= _SPLIT_FROM
        and array.dtype == dtype
        and array.ndim == 1
        and array.flags.c_contiguous
    )


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
