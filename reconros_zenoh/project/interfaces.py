"""The interface definitions of a project: `msg/<package>/{msg,srv,action}/<Type>.{msg,srv,action}`."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rosbags.interfaces import Nodetype

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.ros.definition_lines import SMALL_NAME, TYPE_NAME, Field, definition_line
from reconros_zenoh.ros.definitions import action_definitions, message_definition, service_definitions
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_DEFINITIONS = {"msg": message_definition, "srv": service_definitions, "action": action_definitions}


@dataclass(frozen=True)
class Interfaces:
    """The interface definitions of a project, text and file by ROS 2 name (`sorter_msgs/srv/Sort`)."""

    texts: dict[str, str]
    paths: dict[str, Path]

    def registry(self) -> TypeRegistry:
        """Return a registry that knows them; `FileError` for a field whose type is not known."""
        registry = TypeRegistry()
        for name, text in self.texts.items():
            with _named(self.paths[name]):
                registry.add(name, text)
        for name, text in self.texts.items():
            for line, message in _messages_in(name, text):
                try:
                    registry.message(message)
                except UsageError as error:
                    raise FileError(self.paths[name], line, str(error)) from error
        return registry


def read_interfaces(project_folder: Path) -> Interfaces:
    """Return the definitions in the folder `msg` of a project, none if there is no such folder.

    `FileError` names the file and the line of what is no definition, and a definition in the wrong place.
    Whether the types of the fields exist is looked up by `Interfaces.registry`.
    """
    root = project_folder / "msg"
    paths: dict[str, Path] = {}
    for kind in _DEFINITIONS:
        for path in root.rglob(f"*.{kind}"):
            paths[_interface_name(path, root, kind)] = path
    texts = {name: read_text_file(paths[name]) for name in sorted(paths)}
    for name, text in texts.items():
        with _named(paths[name]):
            _DEFINITIONS[name.split("/")[1]](name, text)
    return Interfaces(texts, {name: paths[name] for name in texts})


def _interface_name(path: Path, root: Path, kind: str) -> str:
    package, *rest = path.relative_to(root).parts
    if rest != [kind, path.name] or not SMALL_NAME.fullmatch(package):
        raise FileError(
            path,
            None,
            f"A .{kind} file stands in the wrong place or in a package of a wrong name.",
            f"Move it to msg/<package>/{kind}/{path.name}, the package in small letters.",
        )
    if not TYPE_NAME.fullmatch(path.stem):
        raise FileError(
            path, None, f"{path.stem!r} is no name of a ROS 2 type.", "Use CamelCase without underscores."
        )
    return f"{package}/{kind}/{path.stem}"


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Let a FileError that names a type name its file."""
    try:
        yield
    except FileError as error:
        raise FileError(path, error.line, error.problem, error.remedy) from error


def _messages_in(name: str, text: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the type of each field that holds messages, in a text that is checked."""
    package = name.split("/", maxsplit=1)[0]
    for number, line in enumerate(text.splitlines(), start=1):
        defined = definition_line(package, line) if line != "---" else None
        if isinstance(defined, Field):
            form = defined.form
            element = form[1][0] if form[0] in {Nodetype.ARRAY, Nodetype.SEQUENCE} else form
            if element[0] == Nodetype.NAME:
                yield number, element[1]
