"""The line level of `build.cfg`: sections and options, each with the line it stands in.

Python's configparser reads the same files but keeps no line numbers, and an error without its line is of
little use in a file of several hundred lines.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.numbered_names import NumberedName, parse_numbered_names
from reconros_zenoh.text_file import read_old_text_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

_AT = re.compile(r"@|\(at\)")
# An indented line of this form is an indented option; any other indented line goes on with the value above.
_INDENTED_OPTION = re.compile(r"[A-Za-z_%][\w%]*\s*=")
# `name: value` as configparser has it; the blank tells it from a rectangle of sites that goes on a line.
_COLON_OPTION = re.compile(r"([A-Za-z_%][\w%]*)\s*:(?:\s+|\Z)([^=]*)")
# A comment behind a value: the mark after a blank and outside quotes.
_TRAILING_COMMENT = re.compile(r"""((?:[^"]|"[^"]*")*?)\s+[#;].*""")
_FREE_TEXT = re.compile(r".*Flags|TargetBoardPassword")
_NUMBER = re.compile(r"[0-9]{1,18}")


@dataclass(frozen=True)
class Option:
    """One `name = value`; a value of several lines is joined by newlines, without their indentation."""

    path: Path
    line: int
    name: str
    value: str
    value_lines: tuple[int, ...]

    def error(self, problem: str, remedy: str = "", offset: int = 0) -> FileError:
        """Return an error that names the line in which the character `offset` of the value stands."""
        return FileError(self.path, self.line_at(offset), problem, remedy)

    def line_at(self, offset: int) -> int:
        """Return the line in which the character `offset` of the value stands."""
        return self.value_lines[self.value.count("\n", 0, offset)]

    def numbered_names(self, remedy: str) -> list[NumberedName]:
        """Return the names that the value lists, such as `slot(0:3)`; `FileError` if it is no such list."""
        try:
            return parse_numbered_names(self.value)
        except ValueError as error:
            raise self.error(f"{self.name}: {error}", remedy) from None


@dataclass(frozen=True)
class Section:
    """One section: `[kind]` or `[kind@label]`, with its options in the order of the file."""

    path: Path
    line: int
    kind: str
    label: str
    options: dict[str, Option] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"[{self.kind}@{self.label}]" if self.label else f"[{self.kind}]"

    def error(self, problem: str, remedy: str = "") -> FileError:
        """Return an error that names the line of the heading."""
        return FileError(self.path, self.line, problem, remedy)

    def numbered_label(self) -> NumberedName:
        """Return the name behind the `@` and its range; `FileError` if there is none or more than one."""
        try:
            [label] = parse_numbered_names(self.label)
        except ValueError:
            raise self.error(
                f"{self} has no usable name.", f"Write `[{self.kind}@name]` or `[{self.kind}@name(0:3)]`."
            ) from None
        return label

    def required(self, name: str) -> Option:
        """Return the option `name`; `FileError` if it is missing or empty."""
        option = self.options.get(name)
        if option is None:
            raise self.error(f"{self} has no {name}.", f"Add a line `{name} = ...`.")
        if not option.value:
            raise option.error(f"{name} of {self} has no value.", "Write one behind the `=`.")
        return option

    def value(self, name: str) -> str | None:
        """Return the text of the option `name`, None if it is missing or empty."""
        option = self.options.get(name)
        return option.value or None if option else None

    def boolean(self, name: str, *, default: bool) -> bool:
        """Return the option `name`, true or false in any case, `default` if it is missing or empty.

        `FileError` for another value.
        """
        option = self.options.get(name)
        if option is None or not option.value:
            return default
        if option.value.lower() not in {"true", "false"}:
            raise option.error(f"{name} is {option.value!r}.", "Write true or false.")
        return option.value.lower() == "true"

    def number(self, name: str) -> int:
        """Return the whole number of the option `name`; `FileError` if it is missing or something else."""
        option = self.required(name)
        if not _NUMBER.fullmatch(option.value):
            raise option.error(f"{name} is {option.value!r}, not a number.", "Write a whole number.")
        return int(option.value)


def read_sections(path: Path, warnings: list[str]) -> list[Section]:
    """Return the sections of a project file in their order; equal headings stay separate sections.

    `#` or `;` starts a comment line, and a comment behind a value unless that is free text (flags). Nothing
    is interpolated. `FileError` for a line that is none of heading, option, continuation and comment, and
    for an option that stands twice in one section.
    """
    sections: list[Section] = []
    option: Option | None = None
    for number, line in enumerate(read_old_text_file(path, warnings).split("\n"), start=1):
        text = line.strip()
        if not text or text[0] in "#;":
            continue
        if text.startswith("["):
            sections.append(_heading(path, number, text))
            option = None
            continue
        if option is not None and line[0].isspace() and not _INDENTED_OPTION.match(text):
            option = _continued(option, number, text)
        else:
            option = _option(path, number, text)
            if not sections:
                raise option.error("An option stands before the first section.", "Start with `[General]`.")
            earlier = sections[-1].options.get(option.name)
            if earlier is not None:
                raise option.error(
                    f"{option.name} stands twice in {sections[-1]}, first in line {earlier.line}.",
                    "Remove or rename one of them.",
                )
        sections[-1].options[option.name] = option
    return sections


def unique_names(sections: Iterable[Section]) -> Iterator[tuple[str, Section]]:
    """Yield sections of one kind with their names; `FileError` for a bad name or one that stands twice."""
    lines: dict[str, int] = {}
    for section in sections:
        label = section.numbered_label()
        if label != NumberedName(label.name):
            raise section.error(f"{section} cannot have a range.", f"Write `[{section.kind}@{label.name}]`.")
        if label.name in lines:
            raise section.error(
                f"{section} stands twice, first in line {lines[label.name]}.", "Give each a name of its own."
            )
        lines[label.name] = section.line
        yield label.name, section


def _heading(path: Path, number: int, text: str) -> Section:
    heading, bracket, rest = text[1:].rpartition("]")
    if not bracket or rest.strip()[:1] not in {"", "#", ";"}:
        raise FileError(
            path,
            number,
            f"The heading {text!r} does not end with `]`.",
            "Write `[Kind@name]` alone in its line.",
        )
    kind, *label = _AT.split(heading, maxsplit=1)
    return Section(path, number, kind.strip(), label[0].strip() if label else "")


def _option(path: Path, number: int, text: str) -> Option:
    colon = _COLON_OPTION.fullmatch(text)
    name, equals, value = (colon[1], ":", colon[2]) if colon else text.partition("=")
    name = name.strip()
    if not equals or not name:
        raise FileError(
            path,
            number,
            f"{text!r} is neither a heading nor `name = value`.",
            "Start a comment with `#`; indent a line that goes on with the value above it.",
        )
    return Option(path, number, name, _without_comment(name, value), (number,))


def _continued(option: Option, number: int, text: str) -> Option:
    text = _without_comment(option.name, text)
    if not option.value:
        return replace(option, value=text, value_lines=(number,))
    return replace(option, value=f"{option.value}\n{text}", value_lines=(*option.value_lines, number))


def _without_comment(name: str, text: str) -> str:
    # The blank makes a value that is nothing but a comment end before it.
    comment = None if _FREE_TEXT.fullmatch(name) else _TRAILING_COMMENT.fullmatch(f" {text}")
    return (comment[1] if comment else text).strip()
