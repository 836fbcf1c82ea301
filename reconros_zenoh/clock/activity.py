"""A process that goes on at once when it is called, without an event in between."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Generator

    import simpy


class Activity:
    """Drives a generator like `simpy.Process`, from the moment it is made.

    The generator yields events to wait for, or None to park until `resume`. A `simpy.Process` needs an event to
    begin and another to be woken; in wall time those are most of what a message costs.
    """

    def __init__(self, generator: Generator[simpy.Event | None, Any, object]) -> None:
        self._generator = generator
        self.parked = True
        self.resume()

    def resume(self) -> None:
        """Go on now if parked, else do nothing."""
        if self.parked:
            self.parked = False
            self._advance(None)

    def _advance(self, event: simpy.Event | None) -> None:
        """Run the generator until it parks, ends, or waits for an event that has not happened."""
        while True:
            try:
                if event is None:
                    waited_for = next(self._generator)
                elif event.ok:
                    waited_for = self._generator.send(event.value)
                else:
                    event.defused = True
                    waited_for = self._generator.throw(cast("BaseException", event.value))
            except StopIteration:
                return
            if waited_for is None:
                self.parked = True
                return
            if waited_for.callbacks is not None:
                waited_for.callbacks.append(self._advance)
                return
            event = waited_for
