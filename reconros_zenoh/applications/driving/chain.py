"""When the nodes of the chain from Image Compensation to Lane Control had a picture."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

STATIONS = ("compensation", "blur", "lane_planner", "polyfit", "lane_control")
"""Each counts as reached when the node has its input: what lies in memory, it has read."""


class Chain:
    """Notes when which station had which picture, by `clock_ns`."""

    def __init__(self, clock_ns: Callable[[], int]) -> None:
        self._clock_ns = clock_ns
        self._reached_ns: dict[str, list[int]] = {}

    def note(self, station: str, name: str) -> None:
        """Note that a station has the picture of this name, if the first one had it, too."""
        if station == STATIONS[0]:
            self._reached_ns[name] = []
        if name in self._reached_ns:
            self._reached_ns[name].append(self._clock_ns())

    def sections_ns(self) -> dict[str, list[int]]:
        """Return the times [ns] from station to station of each picture that came through, by its name."""
        return {
            name: [there - here for here, there in pairwise(reached)]
            for name, reached in self._reached_ns.items()
            if len(reached) == len(STATIONS)
        }
