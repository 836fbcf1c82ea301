"""Times in messages (builtin_interfaces/Time) as nanoseconds."""

from __future__ import annotations

from typing import Any

_SECOND_NS = 1_000_000_000


def set_stamp(stamp: Any, ns: int) -> None:
    """Give a builtin_interfaces/Time this value [ns]."""
    stamp.sec, stamp.nanosec = divmod(ns, _SECOND_NS)


def stamp_ns(stamp: Any) -> int:
    """Return the value of a builtin_interfaces/Time [ns]."""
    return int(stamp.sec * _SECOND_NS + stamp.nanosec)
