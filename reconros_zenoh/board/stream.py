"""Messages of one endpoint on their way through the board, one after the other."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Generic, TypeVar

from reconros_zenoh.clock.activity import Activity

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from reconros_zenoh.clock.activity import Awaitable

T = TypeVar("T")


class Stream(Generic[T]):
    """Hands items to a process in order: the next when it is done with the one before.

    At most `depth` wait (None: any number); a further one pushes the oldest out (KEEP_LAST) and is counted in
    `dropped`.
    """

    def __init__(
        self, process: Callable[[T], Generator[Awaitable, object, object]], depth: int | None
    ) -> None:
        self._process = process
        self._waiting: deque[T] = deque(maxlen=depth)
        self._activity = Activity(self._run())
        self.dropped = 0

    def put(self, item: T) -> None:
        """Append an item."""
        if len(self._waiting) == self._waiting.maxlen:
            self.dropped += 1
        self._waiting.append(item)
        self._activity.resume()

    def _run(self) -> Generator[Awaitable | None, object, None]:
        while True:
            while self._waiting:
                yield from self._process(self._waiting.popleft())
            yield None
