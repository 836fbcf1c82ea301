"""How long a callback takes: from the profile's table, from declared cycles, or from what the host took."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from reconros_zenoh.board.profile import CallbackSection, Profile

_SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Cycles:
    """The callback computes for this many cycles: of the slot's clock in hardware, of a core in software."""

    count: int

    def __post_init__(self) -> None:
        check_cycles("Cycles", self.count)


@dataclass(frozen=True, slots=True)
class Native:
    """The callback computes for as long as this host took, times `factor`. Repeats differ, as hosts do."""

    factor: float = 1.0

    def __post_init__(self) -> None:
        if not (isinstance(self.factor, int | float | np.number) and 0 < self.factor < inf):
            raise UsageError(f"Native({self.factor!r}): write a factor above 0.")


Timing: TypeAlias = Cycles | Native


@dataclass(frozen=True, slots=True)
class FixedTime:
    """The callback computes for `ns` each time, as the profile's table or the declared cycles say."""

    basis: Literal["table", "cycles"]
    ns: int


ExecutionTime: TypeAlias = FixedTime | Native | None
"""How long one callback computes in one place; None where nothing is modelled: as long as it takes."""


def software_time(profile: Profile, callback: str, timing: Timing | None) -> ExecutionTime:
    """Return the core time of the callback; raise UsageError when nothing says how long it takes."""
    if profile.model is None:
        return None
    if timing is not None:
        return _declared(timing, profile.model.cores.clock.hz)
    return FixedTime("table", _table(profile, callback, "software").software.ns)


def hardware_time(profile: Profile, callback: str, timing: Timing | None, clock_hz: float) -> ExecutionTime:
    """Return how long a slot with this clock computes; raise UsageError when nothing says it.

    The table's time holds at the profile's `thread_clock`: a slot at half of it takes twice as long.
    """
    if profile.model is None:
        return None
    if timing is not None:
        return _declared(timing, clock_hz)
    table_ns = _table(profile, callback, "hardware").compute.ns
    return FixedTime("table", round(table_ns * profile.model.fabric.thread_clock.hz / clock_hz))


def check_cycles(given: str, count: float) -> None:
    """Raise UsageError unless there can be so many cycles; `given` is what they were given to."""
    if not (isinstance(count, int | float | np.number) and 0 <= count < inf):
        raise UsageError(f"{given}({count!r}): write 0 or more cycles.")


def cycles_ns(count: int, clock_hz: float) -> int:
    """Return how long so many cycles take [ns]."""
    # A number of a message may be a numpy one of 32 bits, which the product would not fit.
    return round(int(count) * _SECOND_NS / clock_hz)


def describe(time: ExecutionTime) -> dict[str, Any]:
    """Return what the time rests on, and what goes with it, for status and reports."""
    if isinstance(time, FixedTime):
        return {"basis": time.basis, "ms": time.ns / 1e6}
    return {"basis": "native", "factor": time.factor if time else 1.0}


def _declared(timing: Timing, clock_hz: float) -> ExecutionTime:
    return FixedTime("cycles", cycles_ns(timing.count, clock_hz)) if isinstance(timing, Cycles) else timing


def _table(profile: Profile, callback: str, side: str) -> CallbackSection:
    assert profile.model is not None
    section = profile.model.callbacks.get(callback)
    if section is None:
        raise UsageError(
            f"profile {profile.name!r} has no times for callback {callback!r}. Add the callback with "
            f"timing=Cycles(n) or timing=Native(factor), in app.register {side}_timing, or add a section "
            f"[model.callbacks.{callback}] to a copy of the profile."
        )
    return section
