"""Messages as the C structs that rosidl makes of them: sizes, alignments and offsets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from rosbags.interfaces import Nodetype

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.forms import is_string, number

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc

    from reconros_zenoh.ros.types import MessageType


@dataclass(frozen=True, slots=True)
class CStruct:
    """The layout of a message: size and alignment [byte], and offset and form of each field by name."""

    size: int
    alignment: int
    fields: dict[str, tuple[int, FieldDesc]]


class CLayout:
    """The layouts of all messages for pointers of 4 or 8 bytes.

    Strings and sequences, bounded or not, are `{data*, size, capacity}`, fixed arrays stand in place, and
    every number is aligned to its size (rosidl_runtime_c; AAPCS and AAPCS64).
    """

    def __init__(self, pointer_bytes: int) -> None:
        self.pointer = np.dtype(f"<u{pointer_bytes}")
        self._structs: dict[str, CStruct] = {}

    def struct(self, message_type: MessageType) -> CStruct:
        """Return the layout of the struct of this type."""
        known = self._structs.get(message_type.type_hash)
        if known is not None:
            return known
        offset, alignment = 0, 1
        fields: dict[str, tuple[int, FieldDesc]] = {}
        for name, form in message_type.fields:
            size, aligned = self.size(message_type, form)
            offset += -offset % aligned
            fields[name] = (offset, form)
            offset += size
            alignment = max(alignment, aligned)
        struct = CStruct(offset + -offset % alignment, alignment, fields)
        self._structs[message_type.type_hash] = struct
        return struct

    def size(self, message_type: MessageType, form: FieldDesc) -> tuple[int, int]:
        """Return size and alignment of a field of this form in a message of this type."""
        if form[0] == Nodetype.SEQUENCE or is_string(form):
            return 3 * self.pointer.itemsize, self.pointer.itemsize
        if form[0] == Nodetype.ARRAY:
            size, alignment = self.size(message_type, form[1][0])
            return size * form[1][1], alignment
        if form[0] == Nodetype.NAME:
            struct = self.struct(message_type.nested(form[1]))
            return struct.size, struct.alignment
        itemsize = number(form).itemsize
        return itemsize, itemsize

    def offsetof(self, message_type: MessageType, path: str) -> int:
        """Return the offset of a field: `data`, `header.stamp.sec`, `data.data`, `data.size`.

        The last two are the pointer and the length of a sequence or string, as in Listing 2 of ReconROS
        Executor, Section IV. Raises UsageError for what the message does not have.
        """
        offset = 0
        owner: MessageType | None = message_type
        members: tuple[str, ...] = ()
        for part in path.split("."):
            if owner is not None:
                fields = self.struct(owner).fields
                if part not in fields:
                    raise _no_field(message_type, path, fields)
                add, form = fields[part]
                owner, members = self._inside(owner, form)
            elif part in members:
                add, members = members.index(part) * self.pointer.itemsize, ()
            else:
                raise _no_field(message_type, path, members)
            offset += add
        return offset

    def _inside(self, owner: MessageType, form: FieldDesc) -> tuple[MessageType | None, tuple[str, ...]]:
        """Return what a path may go on into behind a field of this form: a message, or named words."""
        if form[0] == Nodetype.NAME:
            return owner.nested(form[1]), ()
        if form[0] == Nodetype.SEQUENCE or is_string(form):
            return None, ("data", "size", "capacity")
        return None, ()


def _no_field(message_type: MessageType, path: str, known: object) -> UsageError:
    names = ", ".join(known) if isinstance(known, dict | tuple) else ""
    return UsageError(
        f"{message_type.name} has no {path!r}"
        + (f": where it goes wrong there are {names}." if names else ".")
    )
