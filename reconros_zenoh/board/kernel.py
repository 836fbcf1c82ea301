"""Hardware callbacks that are a plain function with declared transfers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import numpy as np

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable


@dataclass(frozen=True, slots=True)
class Kernel:
    """A hardware callback: read fields of the message, compute, write the result, publish or answer.

    `function` gets the fields named in `reads` (`"data"`, `"header.stamp.sec"`; none for a timer), a number
    as an array of one, and returns an array, which is written to memory. `answer(message, result)` makes the
    message from it that goes to `publish`; without a publisher, for a service, it is the response. The
    function must be pure.
    """

    function: Callable[..., np.ndarray[Any, Any]]
    reads: tuple[str, ...]
    answer: Callable[[Any, np.ndarray[Any, Any]], object]
    publish: MessageWriter | None = None

    def __post_init__(self) -> None:
        if isinstance(self.reads, str):
            raise UsageError(f"Kernel(reads={self.reads!r}): write the fields as a tuple, ({self.reads!r},).")

    def __call__(self, thread: HardwareThread) -> Generator[Awaitable, object, object]:
        """Run as the callback of a hardware thread."""
        message = yield from thread.get_init_data()
        fields = [message.array(name) for name in self.reads]
        for field in fields:
            yield from thread.mem_read(field)
        result = yield from thread.compute(self.function, *fields)
        yield from thread.mem_write(result, to=self.publish)
        response = self.answer(message, result)
        if self.publish is None:
            return response
        yield from thread.publish(self.publish, response)
        return None
