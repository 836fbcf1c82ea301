"""How many bytes the messages of a type have on the wire."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbags.interfaces import Nodetype

from reconros_zenoh.ros.forms import is_string
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc

    from reconros_zenoh.ros.types import MessageType


def smallest_bytes(message_type: MessageType) -> int:
    """Return the bytes of a message whose strings and sequences are empty."""
    return sum(map(len, message_type.encode(zero_message(message_type))))


def fixed_bytes(message_type: MessageType) -> int | None:
    """Return the bytes of every message, None for a type with a string or sequence anywhere in it."""
    return smallest_bytes(message_type) if _is_fixed(message_type) else None


def _is_fixed(message_type: MessageType) -> bool:
    return all(_has_one_size(message_type, form) for _, form in message_type.fields)


def _has_one_size(owner: MessageType, form: FieldDesc) -> bool:
    if form[0] == Nodetype.NAME:
        return _is_fixed(owner.nested(form[1]))
    if form[0] == Nodetype.ARRAY:
        return _has_one_size(owner, form[1][0])
    return form[0] == Nodetype.BASE and not is_string(form)
