"""Processes that go on at once when they are called, without an event in between."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import simpy


R = TypeVar("R")


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

PARK = Signal()
"""What an activity yields to wait until it is resumed."""


def limited(
    steps: Generator[Awaitable, Any, R], deadline: Signal, error: Callable[[], Exception]
) -> Generator[Awaitable, Any, R]:
    """Return what the steps return; when the deadline happens before they end, raise the error.

    It is raised in the steps first, which may wait once more to put things in order; then they are closed.
    Steps that never wait cannot be stopped. What they yield that cannot be waited for is refused as an
    `Activity` does.
    """
    try:
        awaited: Awaitable | _Refused = next(steps)
        while True:
            if not hasattr(awaited, "callbacks"):
                awaited = _Refused(awaited)
            if awaited.callbacks is not None and deadline.callbacks is not None:
                yield _first(awaited, deadline)
            if awaited.callbacks is not None:
                break
            if awaited.ok:
                awaited = steps.send(awaited.value)
            else:
                cast("simpy.Event", awaited).defused = True
                awaited = steps.throw(cast("BaseException", awaited.value))
    except StopIteration as end:
        return cast("R", end.value)
    failure = error()
    # Steps that swallow the error, or raise another, are too late all the same.
    with suppress(Exception):
        value = yield steps.throw(failure)
        steps.send(value)
    steps.close()
    raise failure


def _first(event: Awaitable, deadline: Signal) -> Signal:
    """Return a signal that fires when one of the two happens, neither of which has."""
    first = Signal()

    def happen(_: object) -> None:
        if first.callbacks is not None:
            first.fire()

    assert event.callbacks is not None
    event.callbacks.append(happen)
    deadline.callbacks = [happen]
    return first


class Activity:
    """Drives a generator like `simpy.Process`, from the moment it is made.

    The generator yields events and signals to wait for, or PARK until `resume`; anything else raises
    TypeError in it. A `simpy.Process` needs an event to begin and another to be woken; in wall time those are
    most of what a message costs.
    """

    __slots__ = ("_generator", "parked")

    def __init__(self, generator: Generator[Awaitable, Any, object]) -> None:
        self._generator = generator
        self.parked = True
        self.resume()

    def resume(self) -> None:
        """Go on now if parked, else do nothing."""
        if self.parked:
            self.parked = False
            self._advance(PARK)

    def _advance(self, event: Awaitable | _Refused) -> None:
        """Run the generator until it parks, ends, or waits for something that has not happened."""
        while True:
            try:
                if event.ok:
                    waited_for = self._generator.send(event.value)
                else:
                    cast("simpy.Event", event).defused = True
                    waited_for = self._generator.throw(cast("BaseException", event.value))
            except StopIteration:
                return
            if waited_for is PARK:
                self.parked = True
                return
            try:
                callbacks = waited_for.callbacks
            except AttributeError:
                event = _Refused(waited_for)
                continue
            if callbacks is not None:
                callbacks.append(self._advance)
                return
            event = waited_for


class _Refused:
    """Stands for what was yielded and cannot be waited for."""

    ok = False
    callbacks = None

    def __init__(self, yielded: object) -> None:
        self.value = TypeError(f"{yielded!r} cannot be waited for. Call what takes time with `yield from`.")
