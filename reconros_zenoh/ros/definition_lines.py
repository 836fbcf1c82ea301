"""A line of a .msg, .srv or .action file, read by the rules of rosidl_adapter.

What it accepts and the code generators of ROS 2 then cannot use (`time`, an infinite constant) is refused.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc

SMALL_NAME = re.compile(r"(?!.*__)[a-z](?:[a-z0-9_]*[a-z0-9])?")
"""The name of a package or field."""

TYPE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")

_CONSTANT_NAME = re.compile(r"[A-Z](?:_?[A-Z0-9])*")
_TYPE = re.compile(
    r"(?P<element>[^\[\]<=]*)(?:<=(?P<length>[+-]?[0-9]{1,9}))?"
    r"(?P<array>\[(?:(?P<bounded><=)?(?P<size>[+-]?[0-9]{1,9}))?\])?"
)
_NUMBERS = {
    "bool": "bool",
    "byte": "byte",
    "char": "uint8",  # as rosidl has it
    **{
        name: name
        for name in ("float32", "float64", *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)))
    },
}
_BOOLS = {"true": True, "1": True, "false": False, "0": False}


class LineError(Exception):
    """What is wrong in a line, and the remedy."""


@dataclass(frozen=True, slots=True)
class Field:
    """A field: its form as rosbags has it."""

    name: str
    form: FieldDesc


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant: a number of type `kind`, or a string."""

    name: str
    kind: Any
    value: str | float


def definition_line(package: str, line: str) -> Field | Constant | None:
    """Return what a line of a definition in `package` defines, None for a comment; raise LineError."""
    content = line.replace("\t", " ").split("#", 1)[0].rstrip()
    if not content:
        return None
    kind, _, rest = content.partition(" ")
    name, assignment, value = (part.strip() for part in rest.partition("="))
    if not kind or not name:
        raise LineError(
            f"{content!r} is neither a field, a constant nor a comment.",
            "Write for example 'uint32[] data' or 'uint8 RED=1', with nothing before it.",
        )
    if assignment:
        return _constant(kind, name, value)
    name, _, default = name.partition(" ")
    type_ = _type(package, kind)
    _check_name(SMALL_NAME, name, "field")
    if default and not _is_default(type_, default.lstrip()):
        raise _no_value(default.lstrip(), kind, f"the field {name}")
    return Field(name, type_.form)


def _constant(kind: str, name: str, text: str) -> Constant:
    _refuse_wide(kind)
    if kind not in _NUMBERS and kind != "string":
        raise LineError(
            f"{kind!r} is no type of a constant.", "Write a simple type, a name and a value: 'uint8 RED=1'."
        )
    _check_name(_CONSTANT_NAME, name, "constant")
    try:
        value = _value(_NUMBERS.get(kind, kind), text)
    except ValueError:
        value = math.nan
    if isinstance(value, float) and not math.isfinite(value):
        raise _no_value(text, kind, f"the constant {name}")
    return Constant(name, kind, value)


class _Type(NamedTuple):
    """The type of a field; `primitive` is None for a message, a bound or size of 0 stands for none."""

    primitive: str | None
    form: FieldDesc
    length: int = 0
    is_array: bool = False
    is_bounded: bool = False
    size: int = 0


def _type(package: str, kind: str) -> _Type:
    _refuse_wide(kind)
    match = _TYPE.fullmatch(kind)
    if match is None or (match["length"] and match["element"] != "string"):
        raise _no_type(kind)
    if any(match[part] is not None and int(match[part]) < 1 for part in ("length", "size")):
        raise LineError(f"{kind!r}: a size or bound is below 1.", "Write [] for as many as there are.")
    length, size = int(match["length"] or 0), int(match["size"] or 0)
    primitive = _NUMBERS.get(match["element"], "string" if match["element"] == "string" else None)
    element: Any = (Nodetype.BASE, (primitive, length))
    if primitive is None:
        element = (Nodetype.NAME, _message_name(package, match["element"]))
    if not match["array"]:
        return _Type(primitive, element, length)
    is_bounded = match["bounded"] is not None
    array: Any = Nodetype.ARRAY if size and not is_bounded else Nodetype.SEQUENCE
    return _Type(primitive, (array, (element, size)), length, True, is_bounded, size)


def _message_name(package: str, name: str) -> str:
    its_package, slash, type_name = name.rpartition("/")
    if not TYPE_NAME.fullmatch(type_name) or (slash and not SMALL_NAME.fullmatch(its_package)):
        raise _no_type(name)
    return f"{its_package or package}/msg/{type_name}"


def _is_default(type_: _Type, text: str) -> bool:
    """Tell whether ROS 2 takes a default, which makes no difference here. Strings in an array may be any."""
    if type_.primitive is None or (type_.is_array and not (text[0] == "[" and text[-1] == "]")):
        return False
    if type_.is_array and type_.primitive == "string":
        return True
    values = [each.strip() for each in text[1:-1].split(",") if text[1:-1]] if type_.is_array else [text]
    try:
        read = [_value(type_.primitive, each) for each in values]
    except ValueError:
        return False
    if not type_.is_array:
        return not type_.length or len(str(read[0])) <= type_.length
    return not type_.size or len(read) == type_.size or (type_.is_bounded and len(read) < type_.size)


def _value(kind: str, text: str) -> str | float:
    """Return the value of a number of type `kind` or a string; raise ValueError for what is none."""
    if kind == "string":
        return _unquoted(text)
    if kind == "bool":
        if text.lower() not in _BOOLS:
            raise ValueError(text)
        return _BOOLS[text.lower()]
    if kind.startswith("float"):
        return float(text)
    limits = np.iinfo("uint8" if kind == "byte" else kind)
    value = _integer(text)
    if not limits.min <= value <= limits.max:
        raise ValueError(text)
    return value


def _integer(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        return int(text, 0)


def _unquoted(text: str) -> str:
    quote = text[:1]
    if quote not in {'"', "'"} or not text.endswith(quote):
        return text
    inner = text[1:-1]
    if re.search(rf"(?<!\\){quote}", inner):
        raise ValueError(text)
    return inner.replace(f"\\{quote}", quote)


def _check_name(pattern: re.Pattern[str], name: str, what: str) -> None:
    if not pattern.fullmatch(name):
        raise LineError(
            f"{name!r} is no name of a {what}.",
            "Fields are small_letters, constants CAPITALS, without '__' and without '_' at the end.",
        )


def _refuse_wide(kind: str) -> None:
    if kind.startswith("wstring"):
        raise LineError("wstring is not supported.", "Use string, which holds UTF-8.")


def _no_type(kind: str) -> LineError:
    return LineError(
        f"{kind!r} is no type of a field.",
        "Use a type of ROS 2 such as 'uint32', 'string<=10', 'Point', 'geometry_msgs/Point', 'uint32[]'.",
    )


def _no_value(text: str, kind: str, what: str) -> LineError:
    return LineError(f"{text!r} is no value of {what}.", f"Give it one of its type, {kind}.")
