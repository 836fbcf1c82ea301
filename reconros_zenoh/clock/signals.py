"""The signals that ask a process to end, and those that come while an event loop runs."""

from __future__ import annotations

import _thread
import math
import signal
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, the signal of `kill`, and that of a terminal that closes."""

_LONGEST_EVENT_S = 1.0
_FINISHING_S = 5.0


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this process: not SIGHUP where that is ignored, as with `nohup`."""
    kept = {signal.SIGHUP} if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else set()
    return tuple(number for number in ENDING if number not in kept)


class EndingHandler:
    """Ends a command by KeyboardInterrupt, on SIGTERM and SIGHUP, too: through every `finally`.

    For some seconds further signals are ignored, so that what was measured can be written: a second Ctrl-C,
    or the second signal of `timeout`, which sends one to the process and one to its group. Between `hold` and
    `release` the first one waits.
    """

    def __init__(self) -> None:
        self._ignored_until_s = -math.inf
        self._held = False
        self._waits = False

    def __call__(self, *_: object) -> None:
        """Raise KeyboardInterrupt, or not, as described above."""
        now_s = time.monotonic()
        if now_s < self._ignored_until_s:
            return
        first = self._ignored_until_s == -math.inf
        self._ignored_until_s = now_s + _FINISHING_S
        if not (self._held and first):
            raise KeyboardInterrupt
        self._waits = True

    def hold(self) -> None:
        """From now on a first signal waits, and only another one, some seconds later, raises."""
        self._held = True

    def release(self) -> None:
        """From now on the first signal raises; raise KeyboardInterrupt if one waits."""
        self._held = False
        if self._waits:
            self._waits = False
            raise KeyboardInterrupt


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
