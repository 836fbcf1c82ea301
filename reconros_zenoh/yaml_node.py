"""A value of a YAML file that knows its line, with the variables of Compose filled in."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.constructor import DuplicateKeyError, RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.reader import ReaderError

from reconros_zenoh.errors import FileError
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

_NAME = r"[A-Za-z_][A-Za-z0-9_]*"
_VARIABLE = re.compile(
    rf"\$(?:(?P<dollar>\$)|(?P<plain>{_NAME})"
    rf"|\{{(?P<braced>{_NAME})(?:(?P<sign>:?-)(?P<default>[^${{}}]*))?\}}|(?P<wrong>))"
)
# The parser's words; behind them it prints the whole values.
_DUPLICATE_KEY = re.compile(r'duplicate key "(.+?)" with value')
_DEEPEST = 50  # far less than Python can take
_MOST_BITS = 64  # Python prints no number of thousands of digits


class _Composer(Composer):
    """Refuses what is nested deeper than any file of ours."""

    _depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self._depth += 1
        if self._depth > _DEEPEST:
            mark = self.parser.peek_event().start_mark
            raise ComposerError(None, None, "it is nested too deeply", mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


class _Constructor(RoundTripConstructor):
    """Knows in which line (from 0) the value stands that it makes, and refuses endless numbers."""

    line = 0

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        self.line = node.start_mark.line
        value = super().construct_object(node, deep)
        if isinstance(value, int) and value.bit_length() > _MOST_BITS:
            raise ValueError(f"a whole number has at most {_MOST_BITS} bits")
        return value


@dataclass(frozen=True, slots=True)
class YamlNode:
    """One value of a YAML file.

    `name` is its path of keys (`services.router.command`), `line` counts from 1, and `environment` gives the
    values of the variables.
    """

    value: Any
    name: str
    line: int
    path: Path
    environment: Mapping[str, str]

    @classmethod
    def read(cls, path: Path, environment: Mapping[str, str]) -> YamlNode:
        """Return the whole file; raise FileError when it cannot be read or is not YAML."""
        text = read_text_file(path, "Give a readable YAML file.")
        yaml = YAML(typ="rt")
        yaml.Composer, yaml.Constructor = _Composer, _Constructor
        try:
            value = yaml.load(text)
        except ReaderError as error:
            line = text.count("\n", 0, error.position) + 1
            raise FileError(path, line, "has a character that YAML does not allow.", "Remove it.") from None
        except DuplicateKeyError as error:
            key = _DUPLICATE_KEY.search(error.problem)
            raise FileError(
                path,
                error.problem_mark.line + 1,
                f"{key[1] if key else 'a key'} stands twice in the same mapping.",
                "Remove or rename one of them.",
            ) from None
        except MarkedYAMLError as error:
            place = error.problem_mark.line + 1 if error.problem_mark else None
            raise FileError(path, place, f"is not YAML: {error.problem}.", "Correct the syntax.") from None
        except YAMLError as error:
            raise FileError(path, None, f"is not YAML: {error}.", "Correct the syntax.") from None
        except Exception as error:  # noqa: BLE001 # a date or number that cannot be is an error of any kind
            raise FileError(
                path,
                yaml.constructor.line + 1,
                f"has a value that cannot be read ({error}).",
                "Correct it, or put it in quotes.",
            ) from None
        return cls(value, "the file", 1, path, environment)

    def error(self, problem: str, remedy: str) -> FileError:
        """Return the error that names this value, to be raised."""
        return FileError(self.path, self.line, f"{self.name} {problem}", remedy)

    def mapping(self) -> dict[str, YamlNode]:
        """Return the values under their keys, in the order of the file."""
        if not isinstance(self.value, dict):
            raise self._wrong_type("a mapping (`key: value`)")
        for key in self.value:
            if not isinstance(key, str):
                raise self.error(f"has the key {key!r}, which is not a string.", "Put it in quotes.")
        return {key: self._member(key, key) for key in self.value}

    def sequence(self) -> list[YamlNode]:
        """Return the items of the list."""
        if not isinstance(self.value, list):
            raise self._wrong_type("a list")
        return [self._member(index, f"item {index + 1}") for index in range(len(self.value))]

    def text(self) -> str:
        """Return the string with its variables replaced."""
        if not isinstance(self.value, str):
            raise self._wrong_type("a string", "Put it in quotes.")
        return _VARIABLE.sub(self._replacement, self.value)

    def whole_number(self) -> int:
        """Return the number, which may also be given as a string, for instance through a variable."""
        if isinstance(self.value, int) and not isinstance(self.value, bool):
            return int(self.value)
        text = self.text() if isinstance(self.value, str) else ""
        if not re.fullmatch(r"\d{1,19}", text, re.ASCII):
            raise self._wrong_type("a whole number")
        return int(text)

    def number(self) -> float:
        """Return the number, whole or with a fraction."""
        if isinstance(self.value, int | float) and not isinstance(self.value, bool):
            return float(self.value)
        raise self._wrong_type("a number")

    def _member(self, key: str | int, title: str) -> YamlNode:
        # A key that came through a merge (`<<: *anchor`) has no place of its own: its mapping gives the line.
        places = self.value.lc.data or {}
        line = places[key][0] + 1 if key in places else self.line
        name = title if self.name == "the file" else f"{self.name}.{title}"
        return replace(self, value=self.value[key], name=name, line=line)

    def _wrong_type(self, wanted: str, remedy: str = "Correct the value.") -> FileError:
        return self.error(f"must be {wanted}, but is {_kind(self.value)}.", remedy)

    def _replacement(self, found: re.Match[str]) -> str:
        """Return what stands for one `$...` (Compose file reference, "Interpolation").

        Deviation: a variable that is not set and has no default is an error here, where Compose warns and
        takes the empty string, because an address or a file name that is empty by accident fails much later.
        Nested defaults and the forms `:?` and `:+` are errors too.
        """
        if found["dollar"]:
            return "$"
        name = found["plain"] or found["braced"]
        if not name:
            raise self.error(
                f"has a `$` that cannot be replaced: {self.value!r}.",
                "Write ${NAME}, ${NAME:-default} or ${NAME-default}, and $$ for a dollar sign.",
            )
        value = self.environment.get(name)
        if value or (value is not None and found["sign"] != ":-"):
            return value
        if found["default"] is None:
            raise self.error(
                f"needs the variable {name}, which is not set.",
                f"Set it, or write ${{{name}:-default}} in the file.",
            )
        return found["default"]


def _kind(value: object) -> str:
    if value is None:
        return "empty"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    return repr(value)
