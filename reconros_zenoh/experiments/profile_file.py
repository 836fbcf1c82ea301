"""A board profile with other values: in memory, and as a file whose comments and order are kept."""

from __future__ import annotations

import re
import tomllib
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pydantic import ValidationError

from reconros_zenoh.board.profile import Profile
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.experiments.provenance import writing
from reconros_zenoh.text_file import replacing

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from reconros_zenoh.toml_file import TomlFile

_VALUE = re.compile(r"(\bvalue\s*=\s*)[+-]?[0-9][0-9_.eE+-]*")


def varied(profile: Profile, changes: Mapping[tuple[str, ...], float | bool]) -> Profile:
    """Return the profile with other values at these places of its file, as in ("model", "dds", "jitter").

    A place names a quantity, whose value is replaced, or a switch.
    """
    content = profile.model_dump()
    for place, value in changes.items():
        *tables, last = place
        table = content
        for key in tables:
            table = table[int(key) if isinstance(table, tuple) else key]
        if isinstance(table[last], dict):
            table[last]["value"] = value
        else:
            table[last] = value
    return Profile.model_validate(content)


def with_values(source: TomlFile, values: Mapping[tuple[str, ...], float], profile: Profile) -> str:
    """Return the text of a profile's file with the value of each quantity at these places replaced.

    `profile` is what the text must then stand for. Raise FileError, with the line, for a file that is written
    in a way in which its values cannot be replaced.
    """
    lines = source.text.splitlines(keepends=True)
    for place, value in values.items():
        number = source.line([*place, "value"])
        line = lines[number - 1] if number else ""
        found = _VALUE.search(line)
        if number is None or found is None:
            raise _not_replaceable(source, place)
        lines[number - 1] = f"{line[: found.start()]}{found[1]}{value:.4g}{line[found.end() :]}"
    text = "".join(lines)
    try:
        if Profile.model_validate(tomllib.loads(text)) == profile:
            return text
    except (tomllib.TOMLDecodeError, ValidationError):
        pass
    raise _not_replaceable(source, next(iter(values)))


@contextmanager
def new_profile(path: Path) -> Iterator[Path]:
    """Give a file to write, as `replacing` does; raise UsageError when `path` cannot be written.

    At once if possible, so that no work is lost.
    """
    with writing(path):
        if path.is_dir():
            raise UsageError(f"{path} is a folder. Name the file of the new profile.")
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial:
            partial.touch()
            yield partial


def _not_replaceable(source: TomlFile, place: tuple[str, ...]) -> FileError:
    name = ".".join(place)
    return FileError(
        source.path,
        source.line(place),
        f"the value of {name} cannot be replaced.",
        f'Write it on one line: {place[-1]} = {{ value = 1, unit = "...", basis = "calibrated" }}.',
    )
