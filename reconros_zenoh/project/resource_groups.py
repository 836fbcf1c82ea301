"""The resources of a project: what its callbacks use of ROS 2 and of the operating system."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import TYPE_CHECKING, cast

from reconros_zenoh.board.hmt import FIFO_DEPTH, FifoPlan
from reconros_zenoh.project.type_names import inline_message_type, ros_type_name

if TYPE_CHECKING:
    from collections.abc import Iterable

    from reconros_zenoh.board.hmt import Policy
    from reconros_zenoh.project.ini import Option, Section

# The arguments of each resource type: a resource type stands for a reference to one, `[...]` may be missing.
_ARGUMENTS = {
    "rosnode": ("name",),
    "rosmsg": ("package", "msg", "Type"),
    "rossub": ("rosnode", "rosmsg", "topic", "[poll_us]"),
    "rospub": ("rosnode", "rosmsg", "topic"),
    "rossrvmsg": ("package", "srv", "Type"),
    "rossrvs": ("rosnode", "rossrvmsg", "service", "[poll_us]"),
    "rossrvc": ("rosnode", "rossrvmsg", "service", "[poll_us]"),
    "rosactionmsg": ("package", "action", "Type"),
    "rosactions": ("rosnode", "rosactionmsg", "action name", "[poll_us]"),
    "rosactionc": ("rosnode", "rosactionmsg", "action name", "[poll_us]"),
    "rostmr": ("rosnode", "period_ms"),
    "mem": ("words",),
    "mbox": ("size",),
    "mutex": (),
    "cond": ("mutex",),
    "sem": ("value",),
}
_HARDWARE_MAPPED = {
    "rossub": ("rosnode", "pkg/Type", "topic", "hw", "[depth]", "[block|drop]", "[message_bytes]"),
    "rospub": ("rosnode", "pkg/Type", "topic", "hw", "[message_bytes]"),
}
_INTERFACES = ("rosmsg", "rossrvmsg", "rosactionmsg")
_ROS_NAMES = ("name", "topic", "service", "action name")
_FIFO_NUMBERS = ("depth", "message_bytes")
_NUMBERS = ("poll_us", "period_ms", "words", "size", "value")
# Listing 1 of ReconROS Executor, Section IV, prints this one.
_MISPRINTS = {"rosmmsg": "rosmsg"}

_TOKEN = re.compile(r'(?:"(?P<quoted>[^"\n]*)"|(?P<plain>[^\s,"]+))(?:[\s,]+|\Z)')


@dataclass(frozen=True)
class Resource:
    """One resource of a group; `args` are the arguments as written, without quotes.

    What the arguments mean, None where a type has no such argument: `node` is the ROS name of the node it
    belongs to, `interface` its type ("sensor_msgs/msg/Image"), `ros_name` the name of the node, topic,
    service or action as written. `number` is the period [ms] of a rostmr, the poll interval [us] of a rossub,
    service or action, the words of a mem, the size of an mbox or the start value of a sem.
    `hardware_mapped` is true for a topic that stays in the FPGA; then `fifo` is what a rossub declares of its
    FIFO, or how large the messages of a rospub can be.
    """

    group: str
    name: str
    type: str
    args: tuple[str, ...]
    line: int
    node: str | None = None
    interface: str | None = None
    ros_name: str | None = None
    number: int | None = None
    hardware_mapped: bool = False
    fifo: FifoPlan = field(default_factory=FifoPlan)


@dataclass(frozen=True)
class _Declaration:
    """A resource whose references are not looked up yet."""

    group: str
    name: str
    type: str
    args: tuple[str, ...]
    arguments: tuple[str, ...]  # the names of `args`
    option: Option


def read_resource_groups(sections: Iterable[Section], warnings: list[str]) -> dict[str, tuple[Resource, ...]]:
    """Return the resources of each `[ResourceGroup@name]` section by the group's name, references resolved.

    A section with a range makes one group per number: name_0, name_1, ... with that number for every `%`.
    A reference is looked up in its own group first. Listing 1 of ReconROS Executor, Section IV, uses the node
    of another group, so what only one other group declares is taken from there, with a warning.
    """
    headings: dict[str, Section] = {}
    declared: dict[str, dict[str, _Declaration]] = {}
    for section in sections:
        for group, number in _groups(section):
            if group in headings:
                raise section.error(
                    f"The resource group {group} stands twice, first in line {headings[group].line}.",
                    "Give each group a name of its own.",
                )
            headings[group] = section
            declarations = declared[group] = {}
            for option in section.options.values():
                declaration = _declaration(group, number, option, warnings)
                if declaration is None:
                    continue
                twin = declarations.setdefault(declaration.name, declaration)
                if twin is not declaration:  # `a0` and `a%`
                    raise option.error(
                        f"{option.name} stands for {twin.name} in {group}, as line {twin.option.line} does.",
                        "Rename one of them.",
                    )
    return {
        group: tuple(_resource(declaration, declared, warnings) for declaration in declarations.values())
        for group, declarations in declared.items()
    }


def _groups(section: Section) -> list[tuple[str, str | None]]:
    """Return the names of the groups of a section, each with the number that stands for `%` in it."""
    label = section.numbered_label()
    if label.numbers is None:
        return [(label.name, None)]
    return [(f"{label.name}_{number}", str(number)) for number in label.numbers]


def _declaration(group: str, number: str | None, option: Option, warnings: list[str]) -> _Declaration | None:
    """Return the resource that an option declares; None, with a warning, for an unknown type of resource."""
    name, value = option.name, option.value
    if number is not None:
        name, value = name.replace("%", number), value.replace("%", number)
    written = re.split(r"[\s,]", value, maxsplit=1)[0]
    resource_type = _MISPRINTS.get(written, written)
    if resource_type not in _ARGUMENTS:
        nearest = get_close_matches(written, _ARGUMENTS, 1)
        warning = (
            f"{option.path}:{option.line}: {option.name} is no known resource and left out: {written!r}. "
            + (f"Did you mean {nearest[0]}?" if nearest else f"Known types: {', '.join(_ARGUMENTS)}.")
        )
        if warning not in warnings:
            warnings.append(warning)
        return None
    tokens: list[str] = []
    position = 0
    while position < len(value):
        match = _TOKEN.match(value, position)
        if match is None or match["quoted"] == "":
            raise option.error(
                f"The arguments of {name} cannot be read from {value[position:]!r} on.",
                'Write `name = type, argument, ...`; a name in quotes is `"/like_this"`.',
                min(position, len(option.value)),
            )
        tokens.append(match["quoted"] or match["plain"])
        position = match.end()
    args = tuple(tokens[1:])
    arguments = _ARGUMENTS[resource_type]
    if resource_type in _HARDWARE_MAPPED and args[3:4] == ("hw",):
        arguments = _HARDWARE_MAPPED[resource_type]
    required = sum(not argument.startswith("[") for argument in arguments)
    no_interface = resource_type in _INTERFACES and (args[1:2] != arguments[1:2] or "/" in "".join(args))
    if not required <= len(args) <= len(arguments) or no_interface:
        raise option.error(
            f"The arguments of {name} do not fit {resource_type}.",
            f"Write `{', '.join([f'{name} = {resource_type}', *arguments])}`.",
        )
    return _Declaration(
        group, name, resource_type, args, tuple(word.strip("[]") for word in arguments), option
    )


def _resource(
    declaration: _Declaration, declared: dict[str, dict[str, _Declaration]], warnings: list[str]
) -> Resource:
    node = interface = ros_name = None
    number = None
    if declaration.type in _INTERFACES:
        interface = _interface(declaration)
    for argument, text in zip(declaration.arguments, declaration.args, strict=False):
        if argument in _ROS_NAMES:
            ros_name = text
        elif argument in _NUMBERS:
            number = _number(declaration, argument, text)
        elif argument == "pkg/Type":
            try:
                interface = inline_message_type(text)
            except ValueError as error:
                raise declaration.option.error(
                    str(error), "A hardware-mapped topic names its type."
                ) from None
        elif argument in _ARGUMENTS:
            target = _find(declaration, argument, text, declared, warnings)
            if argument == "rosnode":
                node = target.args[0]
            elif argument in _INTERFACES:
                interface = _interface(target)
    return Resource(
        group=declaration.group,
        name=declaration.name,
        type=declaration.type,
        args=declaration.args,
        line=declaration.option.line,
        node=node,
        interface=interface,
        ros_name=ros_name,
        number=number,
        hardware_mapped="hw" in declaration.arguments,
        fifo=_fifo(declaration),
    )


def _interface(declaration: _Declaration) -> str:
    package, kind, name = declaration.args
    return ros_type_name(package, kind, name)


def _number(declaration: _Declaration, argument: str, text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,18}", text):
        raise declaration.option.error(
            f"{argument} of {declaration.name} is {text!r}, not a number.", "Write a whole number."
        )
    number = int(text)
    if argument == "period_ms" and not number:
        raise declaration.option.error(
            f"The period of the timer {declaration.name} is 0 ms.", "Write 1 or more."
        )
    return number


def _fifo(declaration: _Declaration) -> FifoPlan:
    """Return the FIFO that a hardware-mapped end declares, else the plain one."""
    texts = dict(zip(declaration.arguments, declaration.args, strict=False))
    policy = texts.get("block|drop", "block")
    if policy not in ("block", "drop"):
        raise declaration.option.error(
            f"{declaration.name} says {policy!r} about a full FIFO.", "Write `block` or `drop`."
        )
    numbers = {name: _number(declaration, name, texts[name]) for name in _FIFO_NUMBERS if name in texts}
    for name, number in numbers.items():
        if not number:
            raise declaration.option.error(f"{name} of {declaration.name} is 0.", "Write 1 or more.")
    return FifoPlan(numbers.get("depth", FIFO_DEPTH), cast("Policy", policy), numbers.get("message_bytes"))


def _find(
    declaration: _Declaration,
    wanted: str,
    name: str,
    declared: dict[str, dict[str, _Declaration]],
    warnings: list[str],
) -> _Declaration:
    """Return the declaration of the resource `name` of type `wanted` that `declaration` refers to."""
    option = declaration.option
    own = declared[declaration.group].get(name)
    if own is not None:
        if own.type != wanted:
            raise option.error(
                f"{declaration.name} needs a {wanted}, but {name} is a {own.type} (line {own.option.line}).",
                f"Name a {wanted} of the group {declaration.group}.",
            )
        return own
    elsewhere = [group[name] for group in declared.values() if name in group and group[name].type == wanted]
    if len(elsewhere) != 1:
        found = f"{len(elsewhere)} other groups declare one" if elsewhere else "no group declares one"
        raise option.error(
            f"{declaration.name} refers to the {wanted} {name}: its group {declaration.group} declares none, "
            f"and {found}.",
            f"Declare it in the group: `{', '.join([f'{name} = {wanted}', *_ARGUMENTS[wanted]])}`.",
        )
    warnings.append(
        f"{option.path}:{option.line}: {declaration.name} of {declaration.group} uses {name} of the group "
        f"{elsewhere[0].group}, because its own group declares none."
    )
    return elsewhere[0]
