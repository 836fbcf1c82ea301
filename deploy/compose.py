"""Compose files: what the local runner takes from them.

The file is the one that `docker compose` reads. Keys that only mean something in a container are accepted and
left alone; a key that would change what a service does, and that we do not know, is an error. `volumes` is
one of these: a local process finds the host's files where they are, not where a container has them mounted.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from decimal import Decimal
from enum import StrEnum
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

from reconros_zenoh.yaml_node import YamlNode

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from reconros_zenoh.errors import FileError

_FILE_KEYS = {"services", "name", "networks"}
_CONTAINER_KEYS = {"image", "build", "networks", "container_name", "ports", "init"}
_SERVICE_KEYS = {"command", "environment", "depends_on", "healthcheck"} | _CONTAINER_KEYS
_HEALTHCHECK_KEYS = {"test", "interval", "timeout", "retries", "start_period"}
_SERVICE_NAME = re.compile(r"[A-Za-z0-9._-]+")

_UNITS_NS = {"us": 10**3, "ms": 10**6, "s": 10**9, "m": 60 * 10**9, "h": 3600 * 10**9}
_DURATION_PART = re.compile(r"([0-9]+(?:\.[0-9]+)?)(us|ms|s|m|h)")


class StartCondition(StrEnum):
    """What a service waits for before it starts."""

    STARTED = "service_started"
    HEALTHY = "service_healthy"
    COMPLETED = "service_completed_successfully"


@dataclass(frozen=True, slots=True)
class Healthcheck:
    """How to find out that a service is ready; the defaults are those of Docker's HEALTHCHECK."""

    command: tuple[str, ...]
    interval_ns: int = 30 * 10**9
    timeout_ns: int = 30 * 10**9
    retries: int = 3
    start_period_ns: int = 0


@dataclass(frozen=True, slots=True)
class ComposeService:
    """One service: a command, and what must hold before it is started."""

    name: str
    command: tuple[str, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    depends_on: Mapping[str, StartCondition] = field(default_factory=dict)
    healthcheck: Healthcheck | None = None


@dataclass(frozen=True, slots=True)
class Deployment:
    """The services of a Compose file, in the order of the file."""

    path: Path
    services: dict[str, ComposeService]


def read_compose(path: Path, environment: Mapping[str, str]) -> Deployment:
    """Return the deployment with its variables replaced from `environment`.

    Every mistake raises FileError with the line: a key that is not supported, a wrong type, a dependency that
    is unknown or goes in a circle, a variable that is not set.
    """
    root = YamlNode.read(path, environment)
    entries = root.mapping()
    _check_keys(entries, _FILE_KEYS)
    if "services" not in entries:
        raise root.error("has no services.", "Add a `services:` mapping.")
    nodes = entries["services"].mapping()
    services = {name: _service(name, node) for name, node in nodes.items()}
    for node in nodes.values():
        _check_dependencies(node, services)
    _check_no_cycle(services, nodes)
    return Deployment(path, services)


def duration_ns(text: str) -> int | None:
    """Return a duration such as `500ms` or `1m30s` in nanoseconds, None when it is not one."""
    parts = _DURATION_PART.findall(text)
    if not parts or "".join(number + unit for number, unit in parts) != text:
        return None
    return int(sum(Decimal(number) * _UNITS_NS[unit] for number, unit in parts))


def _service(name: str, node: YamlNode) -> ComposeService:
    if not _SERVICE_NAME.fullmatch(name):
        raise node.error("is no name for a service.", "Use letters, digits, `.`, `_` and `-`.")
    entries = node.mapping()
    _check_keys(entries, _SERVICE_KEYS)
    if "command" not in entries:
        raise node.error("has no command.", "Add `command:`; locally no image supplies one.")
    healthcheck = entries.get("healthcheck")
    environment = entries.get("environment")
    return ComposeService(
        name=name,
        command=_command(entries["command"]),
        environment={} if environment is None else _environment(environment),
        depends_on={other: condition for other, (condition, _) in _dependencies(node).items()},
        healthcheck=None if healthcheck is None else _healthcheck(healthcheck),
    )


def _check_keys(entries: Mapping[str, YamlNode], known: Iterable[str]) -> None:
    for key, node in entries.items():
        if key not in known and not key.startswith("x-"):
            raise node.error(
                "is not a key that the local runner supports.",
                "Correct or remove it, or, if only containers need it, move it to a second file for them "
                f"(docker compose -f FILE -f SECOND); supported here are {', '.join(sorted(known))} and x-*.",
            )


def _command(node: YamlNode) -> tuple[str, ...]:
    if isinstance(node.value, list):
        words = [item.text() for item in node.sequence()]
    else:
        try:
            words = shlex.split(node.text())
        except ValueError as error:
            raise node.error(f"cannot be split into words ({error}).", "Close the quotes.") from None
    if not words or not words[0]:
        raise node.error("is empty.", "Name the program to start.")
    return tuple(words)


def _environment(node: YamlNode) -> dict[str, str]:
    """Return the variables of a service; one without a value is passed on if it is set, as in Compose."""
    if isinstance(node.value, list):
        split = [(item, *item.text().partition("=")) for item in node.sequence()]
        given = [(item, name, value if equals else None) for item, name, equals, value in split]
    else:
        given = [(item, name, _environment_value(item)) for name, item in node.mapping().items()]
    variables = {}
    for item, name, value in given:
        if not name or "=" in name:
            raise item.error(f"is no name of a variable: {name!r}.", "Write NAME=value or NAME: value.")
        known = item.environment.get(name) if value is None else value
        if known is not None:
            variables[name] = known
    return variables


def _environment_value(node: YamlNode) -> str | None:
    if node.value is None:
        return None
    if isinstance(node.value, int | float) and not isinstance(node.value, bool):
        return str(node.value)
    return node.text()


def _dependencies(service: YamlNode) -> dict[str, tuple[StartCondition, YamlNode]]:
    """Return what a service depends on: by name, the condition and the place where it is named."""
    node = service.mapping().get("depends_on")
    if node is None:
        return {}
    if isinstance(node.value, list):
        return {item.text(): (StartCondition.STARTED, item) for item in node.sequence()}
    return {name: (_condition(item), item) for name, item in node.mapping().items()}


def _condition(node: YamlNode) -> StartCondition:
    entries = node.mapping()
    _check_keys(entries, {"condition"})
    if "condition" not in entries:
        raise node.error("has no condition.", f"Add `condition:` with one of {', '.join(StartCondition)}.")
    text = entries["condition"].text()
    if text not in set(StartCondition):
        raise entries["condition"].error(
            f"is unknown: {text!r}.", f"Take one of {', '.join(StartCondition)}."
        )
    return StartCondition(text)


def _healthcheck(node: YamlNode) -> Healthcheck:
    entries = node.mapping()
    _check_keys(entries, _HEALTHCHECK_KEYS)
    if "test" not in entries:
        raise node.error(
            "has no test.", "Add `test:` with a command that succeeds when the service is ready."
        )
    durations = {
        f"{key}_ns": _duration(entries[key], allow_zero=key == "start_period")
        for key in ("interval", "timeout", "start_period")
        if key in entries
    }
    if "retries" not in entries:
        return Healthcheck(_test(entries["test"]), **durations)
    retries = entries["retries"].whole_number()
    if retries < 1:
        raise entries["retries"].error("must be 1 or more.", "Give the number of failures to accept.")
    return Healthcheck(_test(entries["test"]), retries=retries, **durations)


def _test(node: YamlNode) -> tuple[str, ...]:
    if not isinstance(node.value, list):
        return _shell(node, node.text())
    match [item.text() for item in node.sequence()]:
        case ["CMD", program, *arguments] if program:
            return (program, *arguments)
        case ["CMD-SHELL", line]:
            return _shell(node, line)
    raise node.error(
        "is not a healthcheck.", "Write [CMD, program, argument, ...], [CMD-SHELL, line] or the line alone."
    )


def _shell(node: YamlNode, line: str) -> tuple[str, ...]:
    if not line.strip():
        raise node.error("is empty.", "Give the command that succeeds when the service is ready.")
    return ("/bin/sh", "-c", line)


def _duration(node: YamlNode, *, allow_zero: bool) -> int:
    text = node.text()
    value = duration_ns(text)
    if value is None:
        raise node.error(
            f"is not a duration: {text!r}.", "Write numbers with us, ms, s, m or h, as in 1m30s."
        )
    if value == 0 and not allow_zero:
        raise node.error("must be longer than 0.", "Write for instance 500ms.")
    return value


def _check_dependencies(node: YamlNode, services: Mapping[str, ComposeService]) -> None:
    for name, (condition, place) in _dependencies(node).items():
        if name not in services:
            raise place.error(
                f"names no service of this file: {name!r}.", f"Services are {', '.join(services)}."
            )
        if condition is StartCondition.HEALTHY and services[name].healthcheck is None:
            raise place.error(
                f"waits for {name} to be healthy, but {name} has no healthcheck.",
                f"Give {name} a healthcheck, or wait for {StartCondition.STARTED}.",
            )


def _check_no_cycle(services: Mapping[str, ComposeService], nodes: Mapping[str, YamlNode]) -> None:
    try:
        TopologicalSorter({name: service.depends_on for name, service in services.items()}).prepare()
    except CycleError as error:
        raise _cycle(error.args[1], nodes) from None


def _cycle(circle: list[str], nodes: Mapping[str, YamlNode]) -> FileError:
    # graphlib lists each service after one that it must wait for; read backwards it says who waits for whom.
    names = list(reversed(circle))
    return nodes[names[0]].error(
        f"waits for itself: {' -> '.join(names)}.", "Remove one of these entries of depends_on."
    )
