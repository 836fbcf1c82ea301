"""An event loop on the wall clock that a test can watch without waiting a fixed time."""

from __future__ import annotations

from queue import SimpleQueue
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment

if TYPE_CHECKING:
    from collections.abc import Callable

    import simpy

LIMIT_S = 20
"""Long after everything here is over; only a test that fails waits that long."""


class WatchedInbox(SimpleQueue[Any]):
    """Tells when the loop begins to sleep on it."""

    def __init__(self) -> None:
        super().__init__()
        self.sleeps = Event()

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        if self.empty():
            self.sleeps.set()
        return super().get(block, timeout)


class SleepingLoop:
    """A WallEnvironment whose loop runs in a thread of its own and sleeps when `__enter__` returns."""

    def __init__(self, prepare: Callable[[WallEnvironment], None] = lambda _: None) -> None:
        self.environment = WallEnvironment()
        self._inbox = self.environment._inbox = WatchedInbox()
        self._end: simpy.Event = self.environment.event()
        self._thread = Thread(target=self.environment.run, args=(self._end,), daemon=True)
        prepare(self.environment)

    def __enter__(self) -> WallEnvironment:
        self._thread.start()
        assert self._inbox.sleeps.wait(LIMIT_S)
        return self.environment

    def __exit__(self, *_: object) -> None:
        self.environment.post(succeed_once, self._end)
        self._thread.join(LIMIT_S)
        assert not self._thread.is_alive()
