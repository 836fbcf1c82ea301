"""From the text of a .msg, .srv or .action file to the type definitions that rosbags works with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbags.interfaces import Nodetype

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.ros.definition_lines import SMALL_NAME, TYPE_NAME, Field, LineError, definition_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbags.interfaces.typing import Constdefs, Fielddefs, FieldDesc, Typesdict

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


def _package(name: str, kind: str) -> str:
    package, _, rest = name.partition("/")
    its_kind, _, type_name = rest.partition("/")
    if its_kind != kind or not SMALL_NAME.fullmatch(package) or not TYPE_NAME.fullmatch(type_name):
        raise UsageError(
            f"{name!r} cannot be the name of a type. Write package/{kind}/Type, the package in small letters "
            "and the type in CamelCase without '_'."
        )
    return package


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
    separators = [number for number, line in enumerate(lines) if line == "---"]
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
    names = set()
    for number, line in enumerate(lines, first_number):
        try:
            defined = definition_line(package, line)
        except LineError as error:
            raise FileError(name, number, *error.args) from None
        if defined is None:
            continue
        if defined.name in names:
            raise FileError(name, number, f"The name {defined.name} stands twice.", "Rename one of them.")
        names.add(defined.name)
        if isinstance(defined, Field):
            fields.append((defined.name, defined.form))
        else:
            constants.append((defined.name, defined.kind, defined.value))
    return constants, fields
