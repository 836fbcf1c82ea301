"""Processes that go on at once when they are called, without an event in between."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import simpy


class Signal:
    """Something to wait for that happens once; who waits goes on within `fire`.

    It stands wherever a `simpy.Event` could be yielded, and takes no place in the queue of events.
    """

    __slots__ = ("callbacks",)
    ok = True
    value = None

    def __init__(self) -> None:
        self.callbacks: list[Callable[[Any], None]] | None = []

    def fire(self) -> None:
        """Let it happen."""
        callbacks, self.callbacks = self.callbacks, None
        for callback in callbacks or ():
            callback(self)


Awaitable: TypeAlias = "simpy.Event | Signal"
"""What a process may yield to wait for it."""


class Activity:
    """Drives a generator like `simpy.Process`, from the moment it is made.

    The generator yields events and signals to wait for, or None to park until `resume`. A `simpy.Process`
    needs an event to begin and another to be woken; in wall time those are most of what a message costs.
    """

    __slots__ = ("_generator", "parked")

    def __init__(self, generator: Generator[Awaitable | None, Any, object]) -> None:
        self._generator = generator
        self.parked = True
        self.resume()

    def resume(self) -> None:
        """Go on now if parked, else do nothing."""
        if self.parked:
            self.parked = False
            self._advance(None)

    def _advance(self, event: Awaitable | None) -> None:
        """Run the generator until it parks, ends, or waits for something that has not happened."""
        while True:
            try:
                if event is None:
                    waited_for = next(self._generator)
                elif event.ok:
                    waited_for = self._generator.send(event.value)
                else:
                    cast("simpy.Event", event).defused = True
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
