"""For how long a part of the board has been busy."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reconros_zenoh.board.trace import Track
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class BusyTime:
    """The time between each `begin` and the `end` that follows it, and since a `begin` without one.

    With a `track` a trace shows it.
    """

    __slots__ = ("_environment", "_since_ns", "_total_ns", "_track")

    def __init__(self, environment: VirtualEnvironment, track: Track | None = None) -> None:
        self._environment = environment
        self._track = track
        self._total_ns = 0
        self._since_ns: int | None = None

    def begin(self, what: str = "") -> None:
        """Be busy from now on."""
        self._since_ns = self._environment.now
        if self._track is not None:
            self._track.begin(what)

    def end(self) -> None:
        """Be busy no longer."""
        assert self._since_ns is not None
        self._total_ns += self._environment.now - self._since_ns
        self._since_ns = None
        if self._track is not None:
            self._track.end()

    @property
    def ns(self) -> int:
        """The time up to now [ns]."""
        if self._since_ns is None:
            return self._total_ns
        return self._total_ns + self._environment.now - self._since_ns
