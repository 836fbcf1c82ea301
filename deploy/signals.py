"""Ctrl-C and the signals that ask a process to end, held back while nothing may be interrupted."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from reconros_zenoh.clock.signals import ENDING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class EndingSignals:
    """SIGINT, SIGTERM and SIGHUP as exceptions that come at a good moment.

    The first one raises what the handler before it raises, else KeyboardInterrupt (SIGINT) or
    SystemExit(128 + number): at once, or at the end of `held()` when it comes within. Further ones are only
    counted, so that they cannot interrupt the clean-up that the first one began, and of SIGHUP not even that:
    a terminal that closes sends several, and nobody there is in a hurry. `wake` is called for each,
    from a signal handler: it must be reentrant. A signal that the process ignores stays ignored. Thread rule:
    only the main thread can take signals; in another one this object does nothing.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self.count = 0
        self._wake = wake
        self._pending: signal.Signals | None = None
        self._held = False
        self._former: dict[signal.Signals, Any] = {}

    @property
    def pending(self) -> bool:
        """Whether a signal waits for the end of `held()`."""
        return self._pending is not None

    def install(self) -> None:
        """Take the signals over."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in ENDING:
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._former[number] = signal.signal(number, self._receive)

    def restore(self) -> None:
        """Give the signals back to whoever had them."""
        for number, handler in self._former.items():
            signal.signal(number, handler)
        self._former.clear()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep signals from raising until the end of the block."""
        self._held = True
        try:
            yield
        finally:
            self._held = False
        self._raise_pending()

    def _receive(self, number: int, _frame: object) -> None:
        if not self.count:
            self._pending = signal.Signals(number)
        self.count += number != signal.SIGHUP or not self.count
        self._wake()
        if not self._held:
            self._raise_pending()

    def _raise_pending(self) -> None:
        number, self._pending = self._pending, None
        former = self._former.get(number) if number is not None else None
        if callable(former):
            former(number, None)  # raises too, and knows from then on that the end has come
        if number is signal.SIGINT:
            raise KeyboardInterrupt
        if number is not None:
            raise SystemExit(128 + number)
