"""What each part of a board did when, for people who want to look at it."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from reconros_zenoh.board.stages import Stage
    from reconros_zenoh.clock.virtual import VirtualEnvironment

_KEPT = 200_000
"""Nearly two minutes of the round-trip application, and 30 MB."""


class Slice(NamedTuple):
    """A time in which a part did one thing: all of it, or one `stage` of it. In ns since the board began."""

    track: str
    name: str
    stage: Stage | None
    begin_ns: int
    end_ns: int


class Track:
    """One line of a trace: a part that does one thing at a time."""

    __slots__ = ("_environment", "_since_ns", "_slices", "_what", "name")

    def __init__(self, environment: VirtualEnvironment, name: str, slices: deque[Slice]) -> None:
        self._environment = environment
        self._slices = slices
        self.name = name
        self._what: str | None = None
        self._since_ns = 0

    def begin(self, what: str) -> None:
        """Note that the part begins to do this."""
        self._what = what
        self._since_ns = self._environment.now

    def stage(self, stage: Stage, since_ns: int) -> None:
        """Note that a stage of what the part does ends now."""
        if self._what is not None:
            now = self._environment.now
            self._slices.append(Slice(self.name, self._what, stage, max(since_ns, self._since_ns), now))

    def end(self) -> None:
        """Note that it is done."""
        self._slices.extend(self.unfinished())
        self._what = None

    def unfinished(self) -> Iterator[Slice]:
        """Give what the part has been doing up to now, if it does anything."""
        if self._what is not None:
            yield Slice(self.name, self._what, None, self._since_ns, self._environment.now)


class Trace:
    """The tracks of a board, and the last 200,000 slices of what was done there.

    There is one for each software worker and each slot, one for the ICAP, whose work is named by the callback
    that it loads, and one for the communication stack, which works on messages on their way `in` or `out`.
    """

    def __init__(self, environment: VirtualEnvironment) -> None:
        self._environment = environment
        self._began_ns = environment.now
        self._slices: deque[Slice] = deque(maxlen=_KEPT)
        self._software: list[Track] = []
        self._slots: list[Track] = []
        self.icap = Track(environment, "ICAP", self._slices)
        self.stack = Track(environment, "DDS stack", self._slices)

    def add_software_worker(self) -> Track:
        """Return the track of one more software worker."""
        self._software.append(Track(self._environment, f"software {len(self._software)}", self._slices))
        return self._software[-1]

    def add_slot(self, slot_id: int) -> Track:
        """Return the track of one more slot."""
        self._slots.append(Track(self._environment, f"RS{slot_id}", self._slices))
        return self._slots[-1]

    @property
    def tracks(self) -> Sequence[Track]:
        """All tracks, from the software workers to the stack."""
        return (*self._software, *self._slots, self.icap, self.stack)

    def slices(self) -> Iterator[Slice]:
        """Give the slices in the order in which they ended, then what goes on still, up to now."""
        began_ns = self._began_ns
        going_on = (piece for track in self.tracks for piece in track.unfinished())
        for piece in (*self._slices, *going_on):
            yield piece._replace(begin_ns=piece.begin_ns - began_ns, end_ns=piece.end_ns - began_ns)
