"""For how long a part of the board has been busy."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class BusyTime:
    """The time between each `begin` and the `end` that follows it, and since a `begin` without one."""

    __slots__ = ("_environment", "_since_ns", "_total_ns")

    def __init__(self, environment: VirtualEnvironment) -> None:
        self._environment = environment
        self._total_ns = 0
        self._since_ns: int | None = None

    def begin(self) -> None:
        """Be busy from now on."""
        self._since_ns = self._environment.now

    def end(self) -> None:
        """Be busy no longer."""
        assert self._since_ns is not None
        self._total_ns += self._environment.now - self._since_ns
        self._since_ns = None

    @property
    def ns(self) -> int:
        """The time up to now [ns]."""
        if self._since_ns is None:
            return self._total_ns
        return self._total_ns + self._environment.now - self._since_ns
