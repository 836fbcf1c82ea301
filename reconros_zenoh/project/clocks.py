"""The clocks of a design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

    from reconros_zenoh.project.ini import Section


@dataclass(frozen=True)
class Clock:
    """A clock of the design; `source` is "static" or "dynamic"."""

    name: str
    source: str
    hz: int
    line: int


def read_clock(name: str, section: Section) -> Clock:
    """Return the clock of a `[Clock@name]` section."""
    source = section.required("ClockSource")
    if source.value not in {"static", "dynamic"}:
        raise source.error(f"ClockSource is {source.value!r}.", "Write static or dynamic.")
    hz = section.number("ClockFreq")
    if hz == 0:
        raise section.required("ClockFreq").error("ClockFreq is 0.", "Write the frequency in Hz.")
    return Clock(name, source.value, hz, section.line)


def read_clock_name(section: Section, name: str, clocks: Collection[str]) -> str | None:
    """Return the clock that the option `name` names; None without it, `FileError` for an unknown one."""
    option = section.options.get(name)
    if option is not None and option.value not in clocks:
        raise option.error(
            f"{name} of {section} names the unknown clock {option.value!r}.",
            f"Known clocks: {', '.join(clocks) or 'none'}; declare one with `[Clock@{option.value}]`.",
        )
    return option.value if option else None
