"""What has changed, out of what a network reports of tokens and counterparts."""

from __future__ import annotations

from contextlib import closing, suppress
from queue import Empty, Queue
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.transport.base import Declaration, OnMatching

_QUIET_S = 0.1


class MatchingChanges:
    """Passes on whether there is a counterpart: first the present state, then each change."""

    def __init__(self, on_matching: OnMatching) -> None:
        self._on_matching = on_matching
        self._matched: bool | None = None

    def start(self, matched: bool) -> None:
        """Take the present state, unless a report came first: that is newer."""
        if self._matched is None:
            self.report(matched)

    def report(self, matched: bool) -> None:
        """Take a report that may be no news."""
        if matched is not self._matched:
            self._matched = matched
            self._on_matching(matched)


class TokenChanges:
    """Passes on what changes; a network may report a token again when it learns of it another way, too."""

    def __init__(self, on_change: Callable[[str, bool], None]) -> None:
        self._on_change = on_change
        self._alive: set[str] = set()

    def report(self, token: str, is_alive: bool) -> None:
        """Take a report that may be no news."""
        if is_alive == (token in self._alive):
            return
        if is_alive:
            self._alive.add(token)
        else:
            self._alive.remove(token)
        self._on_change(token, is_alive)


def gather(watch_tokens: Callable[[Callable[[str, bool], None]], Declaration], timeout_ns: int) -> list[str]:
    """Return the tokens that are alive: what `watch_tokens` reports until nothing came for 100 ms."""
    changes: Queue[tuple[str, bool]] = Queue()  # SimpleQueue may not hear that time is up, see `Alarm`
    alive: set[str] = set()
    end = monotonic() + timeout_ns / 1e9
    watch = watch_tokens(lambda token, is_alive: changes.put((token, is_alive)))
    with closing(watch), suppress(Empty):
        while True:
            token, is_alive = changes.get(timeout=max(0.0, min(_QUIET_S, end - monotonic())))
            if is_alive:
                alive.add(token)
            else:
                alive.discard(token)
    return sorted(alive)
