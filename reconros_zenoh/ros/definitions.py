"""From the text of a .msg, .srv or .action file to the type definitions that rosbags works with."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError, get_types_from_msg

from reconros_zenoh.errors import FileError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbags.interfaces.typing import Constdefs, Fielddefs, FieldDesc, Typesdict

_NAME = re.compile(r"(?!.*__)(?!.*_/)([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Z][A-Za-z0-9]*)")
_WIDE_STRING = re.compile(r"\s*wstring\b")
_SIZE_BELOW_ONE = re.compile(r"\s*[^\s#]*(\[|<=)(-|\+?0+\b)")
_ASSIGNMENT = re.compile(r"\s*\S+\s+\w+\s*=")
_EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
_GOAL_ID: tuple[str, FieldDesc] = ("goal_id", (Nodetype.NAME, "unique_identifier_msgs/msg/UUID"))
_STAMP: FieldDesc = (Nodetype.NAME, "builtin_interfaces/msg/Time")


def message_definition(name: str, text: str) -> Typesdict:
    """Return the definition of message type `name` (`package/msg/Type`), whose .msg file holds `text`.

    Raises UsageError for a name that ROS 2 does not allow and FileError (with the type in place of the
    path, and the line) for a line that is neither a field, a constant nor a comment.
    """
    package = _package(name, "msg")
    return {name: _definition(package, name, text.splitlines(), 1)}


def service_definitions(name: str, text: str) -> Typesdict:
    """Return the definitions that rosidl makes of service type `name`, whose .srv file holds `text`.

    They are its request, response and event, and under `name` itself the structure of the three whose hash
    is the hash of the service. Raises as `message_definition`.
    """
    request, response = (f"{name}_{part}" for part in ("Request", "Response"))
    definitions = _parts(name, "srv", text, (request, response))
    return {**definitions, **_service(name)}


def action_definitions(name: str, text: str) -> Typesdict:
    """Return the definitions that rosidl makes of action type `name`, whose .action file holds `text`.

    They are its goal, result and feedback, what travels on the wire (the services SendGoal and GetResult, the
    message FeedbackMessage), and under `name` itself the structure of them all whose hash is the hash of the
    action. Raises as `message_definition`.
    """
    goal, result, feedback = (f"{name}_{part}" for part in ("Goal", "Result", "Feedback"))
    definitions = _parts(name, "action", text, (goal, result, feedback))
    send_goal, get_result, message = (
        f"{name}_{part}" for part in ("SendGoal", "GetResult", "FeedbackMessage")
    )
    return {
        **definitions,
        f"{send_goal}_Request": ([], [_GOAL_ID, ("goal", (Nodetype.NAME, goal))]),
        f"{send_goal}_Response": ([], [("accepted", (Nodetype.BASE, ("bool", 0))), ("stamp", _STAMP)]),
        **_service(send_goal),
        f"{get_result}_Request": ([], [_GOAL_ID]),
        f"{get_result}_Response": (
            [],
            [("status", (Nodetype.BASE, ("int8", 0))), ("result", (Nodetype.NAME, result))],
        ),
        **_service(get_result),
        message: ([], [_GOAL_ID, ("feedback", (Nodetype.NAME, feedback))]),
        name: (
            [],
            [
                ("goal", (Nodetype.NAME, goal)),
                ("result", (Nodetype.NAME, result)),
                ("feedback", (Nodetype.NAME, feedback)),
                ("send_goal_service", (Nodetype.NAME, send_goal)),
                ("get_result_service", (Nodetype.NAME, get_result)),
                ("feedback_message", (Nodetype.NAME, message)),
            ],
        ),
    }


def char_as_uint8(description: FieldDesc) -> FieldDesc:
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


def _package(name: str, kind: str) -> str:
    match = _NAME.fullmatch(name)
    if match is None or match[2] != kind:
        raise UsageError(
            f"{name!r} cannot be the name of a type. Write package/{kind}/Type, the package in small letters "
            "and the type in CamelCase without '_'."
        )
    return match[1]


def _service(name: str) -> Typesdict:
    """Return the event of a service and the structure whose hash is the hash of the service."""
    request, response, event = (f"{name}_{part}" for part in ("Request", "Response", "Event"))
    return {
        event: (
            [],
            [
                ("info", (Nodetype.NAME, _EVENT_INFO)),
                ("request", (Nodetype.SEQUENCE, ((Nodetype.NAME, request), 1))),
                ("response", (Nodetype.SEQUENCE, ((Nodetype.NAME, response), 1))),
            ],
        ),
        name: (
            [],
            [
                ("request_message", (Nodetype.NAME, request)),
                ("response_message", (Nodetype.NAME, response)),
                ("event_message", (Nodetype.NAME, event)),
            ],
        ),
    }


def _parts(name: str, kind: str, text: str, parts: Sequence[str]) -> Typesdict:
    """Return the definitions of the parts of a text, which lines `---` divide."""
    package = _package(name, kind)
    lines = text.splitlines()
    separators = [number for number, line in enumerate(lines) if line.strip() == "---"]
    wanted = len(parts) - 1
    if len(separators) != wanted:
        raise FileError(
            name,
            separators[wanted] + 1 if len(separators) > wanted else None,
            f"has {len(separators)} lines '---'.",
            f"A .{kind} file has exactly {wanted}, to divide its {len(parts)} parts.",
        )
    starts = [0, *(separator + 1 for separator in separators)]
    ends = [*separators, len(lines)]
    return {
        part: _definition(package, name, lines[start:end], start + 1)
        for part, start, end in zip(parts, starts, ends, strict=True)
    }


def _definition(
    package: str, name: str, lines: Sequence[str], first_number: int
) -> tuple[Constdefs, Fielddefs]:
    constants: Constdefs = []
    fields: Fielddefs = []
    for number, line in enumerate(lines, first_number):
        if not line.strip():
            continue
        if _WIDE_STRING.match(line):
            raise FileError(name, number, "wstring is not supported.", "Use string, which holds UTF-8.")
        if _SIZE_BELOW_ONE.match(line):  # rosbags takes a bound of 0 for none
            raise FileError(name, number, "a size or bound is below 1.", "Write [] for as many as there are.")
        try:
            more_constants, more_fields = _parsed(package, line)
        except (TypesysError, AssertionError, ValueError):  # the last for a number of thousands of digits
            raise FileError(
                name,
                number,
                f"{line.strip()!r} is neither a field, a constant nor a comment.",
                "Write for example 'uint32[] data' or 'uint8 RED=1'.",
            ) from None
        for constant, kind, value in more_constants:
            try:
                constants.append((constant, kind, _constant_value(kind, value, line)))
            except ValueError:
                raise FileError(
                    name,
                    number,
                    f"{value!r} is no value of the constant {constant}.",
                    f"Give it one of its type, {kind}.",
                ) from None
        fields += [(field, char_as_uint8(description)) for field, description in more_fields]
    return constants, fields


def _parsed(package: str, line: str) -> tuple[Constdefs, Fielddefs]:
    """Return the constants and fields of a line; raise what rosbags raises, ValueError for no constant."""
    # rosbags takes the names of messages only; the name says where `Type` without package is.
    ((constants, fields),) = get_types_from_msg(line, f"{package}/msg/Line").values()
    if fields and _ASSIGNMENT.match(line):
        raise ValueError(line)  # rosbags takes what it cannot read behind the `=` for a default
    return constants, fields


def _constant_value(kind: str, value: str | float, line: str) -> str | float:
    """Return the value that rosbags reads in the line of a constant as one of its type, else ValueError."""
    if kind == "string":  # rosbags has numbers where they look like that
        return value if isinstance(value, str) else line.split("=", 1)[1].split("#", 1)[0].strip()
    if kind in {"float32", "float64"}:
        if not math.isfinite(float(value)):
            raise ValueError(value)
        return float(value)
    limits = np.iinfo("uint8" if kind in {"byte", "char"} else kind) if kind != "bool" else None
    least, most = (limits.min, limits.max) if limits else (0, 1)
    if not isinstance(value, int) or not least <= value <= most:
        raise ValueError(value)
    return int(value) if limits else bool(value)
