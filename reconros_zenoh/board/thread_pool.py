"""Threads for computations that need not end."""

from __future__ import annotations

import logging
import threading
import time
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

P = ParamSpec("P")
R = TypeVar("R")
_log = logging.getLogger(__name__)
_LAST_S = 2.0


class ThreadPool:
    """Runs functions in a fixed number of threads, which end with the process whatever they are doing.

    Deviation: not a `ThreadPoolExecutor`, because its threads keep the process alive: a board with a callback
    that never ends could not be stopped.
    """

    def __init__(self, threads: int, name: str) -> None:
        self._tasks: SimpleQueue[tuple[Future[Any], Callable[[], object]] | None] = SimpleQueue()
        self._closed = False
        self._threads = [
            threading.Thread(target=self._work, name=f"{name} {number}", daemon=True)
            for number in range(threads)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Return the future of `function(...)`; functions begin in the order in which they come.

        Raises RuntimeError after `close`.
        """
        if self._closed:
            raise RuntimeError("the pool of threads is closed")
        future: Future[R] = Future()
        self._tasks.put((future, partial(function, *args, **kwargs)))
        return future

    def close(self) -> None:
        """Begin nothing more, and wait 2 s for what runs; what has not ended then is left and logged."""
        self._closed = True
        with suppress(Empty):
            while (task := self._tasks.get_nowait()) is not None:
                task[0].cancel()
        for _ in self._threads:
            self._tasks.put(None)
        deadline_s = time.monotonic() + _LAST_S
        for thread in self._threads:
            thread.join(max(0.0, deadline_s - time.monotonic()))
        left = sum(thread.is_alive() for thread in self._threads)
        if left:
            _log.warning("%d computations have not ended; nobody waits for them any longer", left)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            future, function = task
            if future.set_running_or_notify_cancel():
                try:
                    result = function()
                except BaseException as error:  # noqa: BLE001 - handed to whoever asks for the result
                    future.set_exception(error)
                else:
                    future.set_result(result)
            del task, future, function  # else the last result would be held until the next
