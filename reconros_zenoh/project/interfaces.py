"""The interface definitions of a project: `msg/<package>/{msg,srv,action}/<Type>.{msg,srv,action}`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# How many `---` lines divide a definition into its parts.
_SEPARATORS = {"msg": 0, "srv": 1, "action": 2}

# The forms of the ROS 2 interface definition language.
_TYPE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_FIELD_TYPE = re.compile(
    r"(?P<primitive>bool|byte|char|float32|float64|u?int(?:8|16|32|64)|w?string(?:<=[0-9]{1,9})?)?"
    r"(?(primitive)|(?:[a-z][a-z0-9_]*/)?[A-Z][A-Za-z0-9]*)"
    r"(?P<array>\[(?:(?:<=)?[0-9]{1,9})?\])?"
)
_SMALL_NAME = re.compile(r"(?!.*__)(?!.*_\Z)[a-z][a-z0-9_]*")
_CONSTANT_NAME = re.compile(r"(?!.*__)(?!.*_\Z)[A-Z][A-Z0-9_]*")
_LINE = re.compile(r"(?P<type>\S+)\s+(?P<name>[^\s#=]+)\s*(?P<rest>.*)")


@dataclass(frozen=True)
class Interfaces:
    """The interface definitions of a project, text and file by ROS 2 name (`sorter_msgs/srv/Sort`)."""

    texts: dict[str, str]
    paths: dict[str, Path]

    def registry(self) -> TypeRegistry:
        """Return a registry that knows them; `FileError` for a field whose type is not known."""
        registry = TypeRegistry()
        for name, text in self.texts.items():
            try:
                registry.add(name, text)
            except FileError as error:
                raise FileError(self.paths[name], error.line, error.problem, error.remedy) from error
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
    for kind in _SEPARATORS:
        for path in root.rglob(f"*.{kind}"):
            paths[_interface_name(path, root, kind)] = path
    texts = {name: read_text_file(paths[name]) for name in sorted(paths)}
    for name, text in texts.items():
        _check(paths[name], text)
    return Interfaces(texts, {name: paths[name] for name in texts})


def _interface_name(path: Path, root: Path, kind: str) -> str:
    package, *rest = path.relative_to(root).parts
    if rest != [kind, path.name] or not _SMALL_NAME.fullmatch(package):
        raise FileError(
            path,
            None,
            f"A .{kind} file stands in the wrong place or in a package of a wrong name.",
            f"Move it to msg/<package>/{kind}/{path.name}, the package in small letters.",
        )
    if not _TYPE_NAME.fullmatch(path.stem):
        raise FileError(
            path, None, f"{path.stem!r} is no name of a ROS 2 type.", "Use CamelCase without underscores."
        )
    return f"{package}/{kind}/{path.stem}"


def _check(path: Path, text: str) -> None:
    separators = 0
    names: set[str] = set()
    kind = path.suffix[1:]
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.strip()
        if content == "---":
            separators += 1
            names = set()
            if separators > _SEPARATORS[kind]:
                raise _separator_error(path, number, kind)
        elif content and not content.startswith("#"):
            name = _checked_name(path, number, content)
            if name in names:
                raise FileError(path, number, f"The name {name} stands twice.", "Rename one of them.")
            names.add(name)
    if separators < _SEPARATORS[kind]:
        raise _separator_error(path, None, kind)


def _messages_in(name: str, text: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the type of each field that holds messages, in a text that is checked."""
    package = name.split("/", maxsplit=1)[0]
    for number, line in enumerate(text.split("\n"), start=1):
        words = line.split("#")[0].split()
        field_type = _FIELD_TYPE.fullmatch(words[0]) if words else None
        if field_type is not None and not field_type["primitive"]:
            message = words[0].split("[")[0]
            yield number, message if "/" in message else f"{package}/{message}"


def _separator_error(path: Path, line: int | None, kind: str) -> FileError:
    return FileError(
        path,
        line,
        f"Too {'few' if line is None else 'many'} lines `---`.",
        f"A .{kind} file has {_SEPARATORS[kind]} of them.",
    )


def _checked_name(path: Path, number: int, content: str) -> str:
    """Return the name of the field or constant that a line defines."""
    match = _LINE.fullmatch(content)
    if match is None:
        raise FileError(
            path,
            number,
            f"{content!r} is neither a field, a constant nor a comment.",
            "Write for example `uint32[] data` or `uint8 RED=1`.",
        )
    field_type = _FIELD_TYPE.fullmatch(match["type"])
    if field_type is None:
        raise FileError(
            path,
            number,
            f"{match['type']!r} is no type of a field.",
            "Use a type of ROS 2 such as `uint32`, `string<=10`, `Point`, `geometry_msgs/Point`, `uint32[]`.",
        )
    is_constant = match["rest"].startswith("=")
    if is_constant and (field_type["array"] or not field_type["primitive"] or match["rest"] == "="):
        raise FileError(
            path,
            number,
            f"{content!r} is no constant.",
            "Write a simple type, a name and a value: `uint8 RED=1`.",
        )
    if not (_CONSTANT_NAME if is_constant else _SMALL_NAME).fullmatch(match["name"]):
        raise FileError(
            path,
            number,
            f"{match['name']!r} is no name of a {'constant' if is_constant else 'field'}.",
            "Fields are small_letters, constants CAPITALS, without `__` and without `_` at the end.",
        )
    return match["name"]
