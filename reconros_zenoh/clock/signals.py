"""Signals that come while an event loop runs."""

from __future__ import annotations

import _thread
import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_LONGEST_EVENT_S = 1.0


@contextmanager
def handled_between_events(call_next: Callable[[Callable[[], None]], None]) -> Iterator[None]:
    """Have the handlers of SIGINT and SIGTERM called by the event loop that runs in the block.

    They raise an exception, as Python's own does for Ctrl-C; raised wherever the model happens to be, it
    could be lost in a finalizer. `call_next` has the loop call something as its next event; it must be
    reentrant. An event that goes on for another second is interrupted, and so is any by a second signal.
    Thread rule: only the main thread can take signals; in another one nothing changes.
    """
    handlers: dict[int, Callable[..., object]] = {}
    received: list[tuple[int, object]] = []
    timers: list[threading.Timer] = []

    def receive(number: int, frame: object) -> None:
        signal.signal(number, cast("Any", handlers[number]))
        received.append((number, frame))
        call_next(handle)
        timers.append(threading.Timer(_LONGEST_EVENT_S, _thread.interrupt_main, (number,)))
        timers[-1].start()

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
        for timer in timers:
            timer.cancel()
        handle()  # what came after the last event
