"""Times that a program gives: a mistake is told where it is made."""

from __future__ import annotations

import math

import numpy as np

from reconros_zenoh.errors import UsageError

_LONGEST_NS = 10**18


def duration_ns(given: str, time: float, unit_ns: int) -> int:
    """Return a time of `unit_ns` units in ns; raise UsageError unless it is one from 1 ns to 10^9 s.

    `given` is where it stands, as `limit_s`.
    """
    ns = float(time) * unit_ns if isinstance(time, int | float | np.number) else math.nan
    if not 1 <= ns <= _LONGEST_NS:
        raise UsageError(f"{given} is {time!r}: write a time above 0, at most {_LONGEST_NS // unit_ns}.")
    return round(ns)
