"""The signals that ask a process to end, and those that come while an event loop runs."""

from __future__ import annotations

import _thread
import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, the signal of `kill`, and that of a terminal that closes."""

_LONGEST_EVENT_S = 1.0


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this process: not SIGHUP where that is ignored, as with `nohup`."""
    kept = {signal.SIGHUP} if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else set()
    return tuple(number for number in ENDING if number not in kept)


@contextmanager
def handled_between_events(call_next: Callable[[Callable[[], None]], None]) -> Iterator[None]:
    """Have the handlers of the ending signals called by the event loop that runs in the block.

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
        for number in ENDING:
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
