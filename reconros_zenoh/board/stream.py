"""Messages of one endpoint on their way through the board, one after the other."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import simpy

    from reconros_zenoh.clock.virtual import VirtualEnvironment

T = TypeVar("T")


class Stream(Generic[T]):
    """Hands items to a process in order: the next when it is done with the one before.

    At most `depth` wait; a further one pushes the oldest out (KEEP_LAST) and is counted in `dropped`.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        process: Callable[[T], Generator[simpy.Event, object, object]],
        depth: int,
    ) -> None:
        self._environment = environment
        self._process = process
        self._waiting: deque[T] = deque(maxlen=depth)
        self._idle: simpy.Event | None = None
        self.dropped = 0
        environment.process(self._run())

    def put(self, item: T) -> None:
        """Append an item."""
        if len(self._waiting) == self._waiting.maxlen:
            self.dropped += 1
        self._waiting.append(item)
        if self._idle is not None:
            self._idle.succeed()
            self._idle = None

    def _run(self) -> Generator[simpy.Event, object, None]:
        while True:
            while self._waiting:
                yield from self._process(self._waiting.popleft())
            self._idle = self._environment.event()
            yield self._idle
