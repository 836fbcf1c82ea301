"""Messages of zeros: what ROS 2 sends where it has nothing to say, as for the result of an unknown goal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype

from reconros_zenoh.ros.c_layout import is_number, number

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc

    from reconros_zenoh.ros.types import MessageType


def zero_message(message_type: MessageType) -> Any:
    """Return the message whose numbers are 0, whose strings and sequences are empty."""
    return message_type.cls(**{name: _zero(message_type, form) for name, form in message_type.fields})


def _zero(owner: MessageType, form: FieldDesc) -> Any:
    if form[0] == Nodetype.NAME:
        return zero_message(owner.nested(form[1]))
    if form[0] == Nodetype.ARRAY or form[0] == Nodetype.SEQUENCE:
        element, length = form[1]
        length = length if form[0] == Nodetype.ARRAY else 0
        if is_number(element):
            return np.zeros(length, number(element))
        return [_zero(owner, element) for _ in range(length)]
    return number(form).type(0).item() if is_number(form) else ""
