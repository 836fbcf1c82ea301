"""The clocks of a design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

    from reconros_zenoh.project.ini import Section


@dataclass(frozen=True)
class Clock:
    """A clock of the design; `source` is "static" or "dynamic", `hz` None if the file does not say."""

    name: str
    source: str
    hz: int | None
    line: int


def read_clock(name: str, section: Section, warnings: list[str]) -> Clock:
    """Return the clock of a `[Clock@name]` section; a missing option is warned of."""
    warnings += [
        f"{section.path}:{section.line}: {section} has no {option}."
        for option in ("ClockSource", "ClockFreq")
        if section.value(option) is None
    ]
    source = section.value("ClockSource") or "static"
    if source not in {"static", "dynamic"}:
        raise section.required("ClockSource").error(f"ClockSource is {source!r}.", "Write static or dynamic.")
    hz = section.number("ClockFreq") if section.value("ClockFreq") else None
    if hz == 0:
        raise section.required("ClockFreq").error("ClockFreq is 0.", "Write the frequency in Hz.")
    return Clock(name, source, hz, section.line)


def read_clock_name(section: Section, name: str, clocks: Collection[str]) -> str | None:
    """Return the clock that the option `name` names; None without it, `FileError` for an unknown one."""
    clock = section.value(name)
    if clock is not None and clock not in clocks:
        raise section.required(name).error(
            f"{name} of {section} names the unknown clock {clock!r}.",
            f"Known clocks: {', '.join(clocks) or 'none'}; declare one with `[Clock@{clock}]`.",
        )
    return clock
