"""Processes of an experiment, each with a connection over which it is told what to do, and answers."""

from __future__ import annotations

import signal
import time
from contextlib import contextmanager, suppress
from multiprocessing import get_context, resource_tracker
from typing import TYPE_CHECKING, Any, Self

from reconros_zenoh.errors import ExperimentError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess


class Processes:
    """Processes that end with the block: those that have not ended `grace_s` later are killed.

    They are started afresh rather than forked, because a process with a progress bar's thread cannot be
    forked safely. Ctrl-C is left to the one that started them.
    """

    def __init__(self, grace_s: float) -> None:
        self._grace_s = grace_s
        self._started: dict[Connection, SpawnProcess] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            for connection in self._started:
                connection.close()
            end_s = time.monotonic() + self._grace_s
            for process in self._started.values():
                process.join(max(0.0, end_s - time.monotonic()))
        finally:
            for process in self._started.values():
                process.kill()  # one that is stopped (Ctrl-Z) would hear nothing else
            for process in self._started.values():
                process.join()

    def start(self, function: Callable[..., None], *arguments: object) -> Connection:
        """Run `function(connection, *arguments)` in a process; return the other end of its connection."""
        spawn = get_context("spawn")
        here, there = spawn.Pipe()
        process = spawn.Process(target=_play, args=(function, there, *arguments), daemon=True)
        with there, terminal_signals_blocked():
            process.start()
            self._started[here] = process
        return here


@contextmanager
def terminal_signals_blocked() -> Iterator[None]:
    """Start processes in the block: they never hear Ctrl-C, not even before their first line of Python.

    Nor do they hear SIGHUP. A terminal sends both to all processes; this one, which hears them after the
    block, ends the others.
    """
    resource_tracker.ensure_running()  # the first process would start it, which unblocks SIGINT
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT, signal.SIGHUP])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def send(connection: Connection, what: object) -> None:
    """Send to a process; raise ExperimentError when it has ended."""
    try:
        connection.send(what)
    except ConnectionError:
        raise _ended_early() from None


def receive(connection: Connection, deadline_s: float | None = None) -> Any:
    """Return what a process sends until the deadline (`time.monotonic`).

    Raise TimeoutError when it is over, and ExperimentError when the process has ended.
    """
    try:
        if deadline_s is not None and not connection.poll(max(0.0, deadline_s - time.monotonic())):
            raise TimeoutError
        return connection.recv()
    except (EOFError, ConnectionError):
        raise _ended_early() from None


def commands(connection: Connection) -> Iterator[Any]:
    """Yield what this process is sent, until nobody holds the other end any more."""
    while True:
        try:
            yield connection.recv()
        except (EOFError, OSError):
            return


def _ended_early() -> ExperimentError:
    return ExperimentError(
        "a process of the experiment ended early. If no reason stands above, it was ended from outside: was "
        "there memory enough?"
    )


def _play(function: Callable[..., None], connection: Connection, *arguments: object) -> None:
    """Run what the process is for, until it ends or nobody hears it any more."""
    with suppress(ConnectionError):
        function(connection, *arguments)
