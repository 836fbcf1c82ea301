"""Message, service and action types: their names, hashes and CDR serialisation, on top of rosbags."""

from __future__ import annotations

import reprlib
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError

from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.ros.field_checks import FieldChecks
from reconros_zenoh.ros.message_arrays import is_unchanging
from reconros_zenoh.ros.names import dds_type_name

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Fielddefs, FieldDesc
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
