"""Messages on their way through a part of the board, one after the other."""

from __future__ import annotations

import logging
from collections import deque
from typing import TYPE_CHECKING, Generic, TypeVar

from reconros_zenoh.board.failures import Failures
from reconros_zenoh.clock.activity import PARK, Activity

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from reconros_zenoh.clock.activity import Awaitable

T = TypeVar("T")
_log = logging.getLogger(__name__)


class SerialQueue(Generic[T]):
    """Hands items to a process in order: the next when it is done with the one before.

    At most `depth` wait (None: any number); a further one pushes the oldest out (KEEP_LAST). `dropped` counts
    what was pushed out, and the items whose process raised: the first error of a type and place is logged,
    and the queue goes on. `on_dropped` gets each of them.
    """

    def __init__(
        self,
        process: Callable[[T], Generator[Awaitable, object, object]],
        depth: int | None,
        on_dropped: Callable[[T], object] = lambda _: None,
    ) -> None:
        self._process = process
        self._on_dropped = on_dropped
        self._waiting: deque[T] = deque(maxlen=depth)
        self.dropped = 0
        self._ways_to_fail = Failures()
        self._activity = Activity(self._run())

    def put(self, item: T) -> None:
        """Append an item."""
        if len(self._waiting) == self._waiting.maxlen:
            self._drop(self._waiting.popleft())
        self._waiting.append(item)
        self._activity.resume()

    def _run(self) -> Generator[Awaitable, object, None]:
        while True:
            while self._waiting:
                item = self._waiting.popleft()
                try:
                    yield from self._process(item)
                except Exception as error:  # noqa: BLE001 - one message must not end the queue
                    self._drop(item)
                    if self._ways_to_fail.is_new(error):
                        _log.exception(
                            "a message was lost on its way through the board; a loss of this kind is not "
                            "reported again"
                        )
                del item  # the last one is not kept while the queue is idle
            yield PARK

    def _drop(self, item: T) -> None:
        self.dropped += 1
        self._on_dropped(item)
