"""Virtual time: the event loop jumps from event to event."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import simpy
from simpy.events import URGENT

from reconros_zenoh.clock.signals import handled_between_events

if TYPE_CHECKING:
    from collections.abc import Callable


class _Present:
    """Where an environment has its time: a slot, which is read without a call, because all read it often."""

    __slots__ = ("_now",)


class VirtualEnvironment(_Present, simpy.Environment):
    """A SimPy environment whose `now` is integer nanoseconds and which takes calls from outside.

    Deterministic: with the same seed the same events happen in the same order, on any machine.
    """

    now: int = vars(_Present)["_now"]  # the slot under another name
    """The present time [ns]."""

    def __init__(self, initial_time_ns: int = 0) -> None:
        super().__init__(initial_time_ns)

    def clock_ns(self) -> int:
        """Return the time of this very moment [ns]; callable from any thread."""
        return self.now

    def peek(self) -> float:
        """Return when the next event is due [ns], infinity without one (SimPy raises and catches then)."""
        return self._queue[0][0] if self._queue else math.inf

    def run(self, until: float | simpy.Event | None = None) -> Any:
        """Run until that time [ns], that event, or the end of all events; see `simpy.Environment.run`.

        Ctrl-C raises KeyboardInterrupt between two events.
        """
        with handled_between_events(self._call_next):
            return super().run(until)

    def post(self, function: Callable[..., object], *arguments: object) -> None:
        """Have `function(*arguments)` called by the event loop now, after what is due already."""
        self.call_later(0, function, *arguments)

    def call_later(self, delay_ns: int, function: Callable[..., object], *arguments: object) -> None:
        """Have `function(*arguments)` called by the event loop after `delay_ns`, which is not negative."""
        if delay_ns < 0:
            raise ValueError(f"Negative delay {delay_ns}")
        # It has what the event loop asks of an event.
        self.schedule(_Call(function, arguments), delay=delay_ns)  # type: ignore[arg-type]

    def _call_next(self, function: Callable[[], None]) -> None:
        self.schedule(_Call(function, ()), URGENT)  # type: ignore[arg-type] # as in call_later


class _Call:
    """A call that is due at some time: an event whose only callback is itself, at half the cost of one."""

    __slots__ = ("_arguments", "_function", "callbacks")
    _ok = True

    def __init__(self, function: Callable[..., object], arguments: tuple[object, ...]) -> None:
        self._function = function
        self._arguments = arguments
        self.callbacks: tuple[_Call] | None = (self,)

    def __call__(self, _: object) -> None:
        self._function(*self._arguments)


def succeed_once(event: simpy.Event) -> None:
    """Let the event happen unless it has happened."""
    if not event.triggered:
        event.succeed()
