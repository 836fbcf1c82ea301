"""From the text of a .msg or .srv file to the type definitions that rosbags works with."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError, get_types_from_msg

from reconros_zenoh.errors import FileError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbags.interfaces.typing import Constdefs, Fielddefs, FieldDesc, Typesdict

_NAME = re.compile(r"(?!.*__)(?!.*_/)([a-z][a-z0-9_]*)/(msg|srv)/([A-Z][A-Za-z0-9]*)")
_EVENT_INFO = "service_msgs/msg/ServiceEventInfo"


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
    package = _package(name, "srv")
    lines = text.splitlines()
    separators = [number for number, line in enumerate(lines) if line.strip() == "---"]
    if len(separators) != 1:
        raise FileError(
            name,
            separators[1] + 1 if separators else None,
            f"has {len(separators)} lines '---'.",
            "A service has exactly one, between its request and its response.",
        )
    (separator,) = separators
    request, response, event = (f"{name}_{part}" for part in ("Request", "Response", "Event"))
    return {
        request: _definition(package, name, lines[:separator], 1),
        response: _definition(package, name, lines[separator + 1 :], separator + 2),
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


def _definition(
    package: str, name: str, lines: Sequence[str], first_number: int
) -> tuple[Constdefs, Fielddefs]:
    constants: Constdefs = []
    fields: Fielddefs = []
    for number, line in enumerate(lines, first_number):
        try:
            # rosbags takes the names of messages only; the name says where `Type` without package is.
            ((more_constants, more_fields),) = get_types_from_msg(line, f"{package}/msg/Line").values()
        except (TypesysError, AssertionError):
            raise FileError(
                name,
                number,
                f"{line.strip()!r} is neither a field, a constant nor a comment.",
                "Write for example 'uint32[] data' or 'uint8 RED=1'.",
            ) from None
        constants += more_constants
        fields += [(field, char_as_uint8(description)) for field, description in more_fields]
    return constants, fields
