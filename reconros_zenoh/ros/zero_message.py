"""Messages of zeros, as ROS 2 sends where it has nothing to say, and those of which some fields are given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.forms import is_number, number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rosbags.interfaces.typing import FieldDesc

    from reconros_zenoh.ros.types import MessageType


_KINDS: Mapping[str, tuple[type, ...]] = {"b": (bool,), "i": (int,), "u": (int,), "f": (int, float)}


def zero_message(message_type: MessageType) -> Any:
    """Return the message whose numbers are 0, whose strings and sequences are empty."""
    return message_type.cls(**{name: _zero(message_type, form) for name, form in message_type.fields})


def message_of(message_type: MessageType, fields: Mapping[str, Any]) -> Any:
    """Return the message with these fields, the others zero, as `ros2 topic pub` makes it of its YAML.

    A nested message is given by a mapping, an array or sequence by a list. Raise UsageError for a field that
    the type does not have, or a value that does not fit.
    """
    message = zero_message(message_type)
    forms = dict(message_type.fields)
    for name, value in fields.items():
        if name not in forms:
            known = ", ".join(forms) or "none"
            raise UsageError(f"{message_type.name} has no field {name!r}. Its fields: {known}.")
        try:
            setattr(message, name, _value(message_type, forms[name], value))
        except (TypeError, ValueError, ArithmeticError) as error:
            raise UsageError(
                f"field {name!r} of {message_type.name} cannot be {value!r}: {error}."
            ) from error
    return message


def _value(owner: MessageType, form: FieldDesc, value: Any) -> Any:
    if form[0] == Nodetype.NAME:
        if not isinstance(value, dict):
            raise TypeError("it is a message, given by its fields")
        return message_of(owner.nested(form[1]), value)
    if form[0] == Nodetype.ARRAY or form[0] == Nodetype.SEQUENCE:
        if not isinstance(value, list):
            raise TypeError("it is a list")
        element, length = form[1]
        if form[0] == Nodetype.ARRAY and len(value) != length:
            raise ValueError(f"it has {length} elements")
        if is_number(element):
            return np.array([_value(owner, element, each) for each in value], number(element))
        return [_value(owner, element, each) for each in value]
    if is_number(form):
        kinds = _KINDS[number(form).kind]
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            raise TypeError(f"it is a {number(form).name}")
        with np.errstate(over="raise"):
            return np.array(value, number(form)).item()
    if not isinstance(value, str):
        raise TypeError("it is a string")
    return value


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
