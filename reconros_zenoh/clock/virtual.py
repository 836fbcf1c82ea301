"""Virtual time: the event loop jumps from event to event."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import simpy
from simpy.events import URGENT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class VirtualEnvironment(simpy.Environment):
    """A SimPy environment whose `now` is integer nanoseconds and which takes calls from outside.

    Deterministic: with the same seed the same events happen in the same order, on any machine.
    """

    def __init__(self, initial_time_ns: int = 0) -> None:
        super().__init__(initial_time_ns)

    @property
    def now(self) -> int:
        """The present time [ns]."""
        return self._now  # type: ignore[return-value] # an integer from the start, and only integers are added

    def clock_ns(self) -> int:
        """Return the time of this very moment [ns]; callable from any thread."""
        return self.now

    def run(self, until: float | simpy.Event | None = None) -> Any:
        """Run until that time [ns], that event, or the end of all events; see `simpy.Environment.run`.

        A handler of SIGINT or SIGTERM (Python's raises KeyboardInterrupt) is called between two events: what
        it raises somewhere in the model could be lost in a finalizer. A second signal is handled at once.
        """
        with self._signals_between_events():
            return super().run(until)

    def post(self, function: Callable[..., object], *arguments: object) -> None:
        """Have `function(*arguments)` called by the event loop now, after what is due already."""
        self.call_later(0, function, *arguments)

    def call_later(self, delay_ns: int, function: Callable[..., object], *arguments: object) -> None:
        """Have `function(*arguments)` called by the event loop after `delay_ns`, which is not negative."""
        if delay_ns < 0:
            raise ValueError(f"Negative delay {delay_ns}")
        self.schedule(_Call(function, arguments), delay=delay_ns)  # type: ignore[arg-type]

    @contextmanager
    def _signals_between_events(self) -> Iterator[None]:
        handlers: dict[int, Callable[..., object]] = {}
        received: list[tuple[int, object]] = []

        def receive(number: int, frame: object) -> None:
            signal.signal(number, cast("Any", handlers[number]))
            received.append((number, frame))
            self.schedule(_Call(handle, ()), URGENT)  # type: ignore[arg-type]

        def handle() -> None:
            while received:
                number, frame = received.pop()
                handlers[number](number, frame)

        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(number)
                if callable(handler):
                    handlers[number] = handler
                    signal.signal(number, receive)
        try:
            yield
        finally:
            for taken, former in handlers.items():
                signal.signal(taken, cast("Any", former))
            handle()  # what came after the last event


class _Call:
    """A call that is due at some time: it has what the event loop asks of an event, at half the cost of one.

    Its only callback is itself.
    """

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
