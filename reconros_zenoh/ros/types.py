"""Message, service and action types: their names, hashes and CDR serialisation, on top of rosbags."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rosbags.interfaces import Nodetype

from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.ros.cdr import DECODE_ERRORS, ENCODE_ERRORS, FieldError, decoder, encoder
from reconros_zenoh.ros.cdr_generator import ENCAPSULATION, fields_of
from reconros_zenoh.ros.message_arrays import is_unchanging
from reconros_zenoh.ros.names import dds_type_name
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc
    from rosbags.typesys.store import Typestore

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
        self.name = name
        self.dds_name = dds_type_name(name)
        self.type_hash = store.hash_rihs01(name)
        self.cls: type[Any] = store.types[name]
        self.fields = fields_of(store, name)
        self._store = store
        self._nested: dict[str, MessageType] = {}
        self._encode = encoder(store, name)
        self._decode = decoder(store, name)

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

    def message(self, /, **fields: object) -> Any:
        """Return a message with these fields; raise UsageError unless they are those of the type."""
        try:
            return self.cls(**fields)
        except TypeError:
            names = [name for name, _ in self.fields]
            wrong = [f"{name!r} is none of them" for name in fields if name not in names]
            wrong += [f"{name!r} is missing" for name in names if name not in fields]
            raise UsageError(
                f"Give a message of type {self.name} its fields, {', '.join(names)}: {', '.join(wrong)}."
            ) from None

    def check(self, message: object) -> None:
        """Raise UsageError for what is no message of this type, which may be that of another registry."""
        found = getattr(message, "__msgtype__", None)
        if found != self.name:
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
        if type(message) is not self.cls:
            self.check(message)
        try:
            payload, array = self._encode(message)
        except ENCODE_ERRORS as error:
            raise UsageError(
                f"A message of type {self.name} cannot be serialised: {self.misfit(message, error)}. "
                "Give every field a value of its type, and arrays of numbers as one-dimensional numpy arrays "
                "of the dtype of the field."
            ) from error
        if array is None:
            return (payload,)
        if array.nbytes < _SPLIT_FROM or not array.flags.c_contiguous:
            return (payload + array.tobytes(),)
        content: bytes | memoryview = array.data.cast("B").toreadonly()
        if not (joined_at_once or is_unchanging(array)):
            content = bytes(content)
        return payload, content

    def misfit(self, message: Any, error: Exception) -> str:
        """Return which field `encode` does not take, and why.

        `error` says so itself only of some fields: numbers are packed together.
        """
        if isinstance(error, FieldError):
            return str(error)
        for name, form in self.fields:
            alone, value = zero_message(self), getattr(message, name, None)
            setattr(alone, name, value)
            try:
                self._encode(alone)
            except ENCODE_ERRORS as its_error:
                if form[0] == Nodetype.NAME and getattr(value, "__msgtype__", None) == form[1]:
                    return self.nested(form[1]).misfit(value, its_error)
                return f"field {name!r} of {self.name} is {reprlib.repr(value)}: {its_error}"
        return str(error)

    def decode(self, payload: bytes | memoryview) -> Any:
        """Return the message that `payload` encodes; its arrays of numbers are views of `payload`.

        What follows the message is not looked at, as in ROS 2, whose `rmw_serialize` gives as many bytes
        as a message takes at most. Raises BadMessageError `truncated` when the bytes end too early or a
        string or array in them does not end rightly, and `foreign_encoding` for another encapsulation than
        CDR little endian and for strings that are not UTF-8.
        """
        if len(payload) < len(ENCAPSULATION):
            raise BadMessageError(
                "truncated", f"{self.name}: no encapsulation header of 4 bytes in a payload of {len(payload)}"
            )
        if payload[0] or payload[1] != _LITTLE_ENDIAN:
            encapsulation = payload[0] << 8 | payload[1]
            kind = _ENCAPSULATIONS.get(encapsulation, "unknown")
            raise BadMessageError(
                "foreign_encoding",
                f"{self.name}: encapsulation {encapsulation:04x} ({kind}), not 0001 (CDR little endian)",
            )
        try:
            return self._decode(payload)
        except UnicodeDecodeError as error:
            raise BadMessageError(
                "foreign_encoding", f"{self.name}: a string is not UTF-8: {error}"
            ) from error
        except DECODE_ERRORS as error:
            raise BadMessageError("truncated", f"{self.name}, {len(payload)} bytes: {error}") from error


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
