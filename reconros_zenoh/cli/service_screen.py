"""The states and log lines of running services on the terminal."""

from __future__ import annotations

import itertools
import os
import signal
import threading
from contextlib import nullcontext
from typing import TYPE_CHECKING, Self

from rich.live import Live
from rich.text import Text

from deploy.logs import LogReader
from deploy.service_run import ServiceState

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from rich.console import Console

_COLOURS = ("cyan", "yellow", "green", "magenta", "blue", "bright_cyan", "bright_yellow", "bright_green")
_BAD = {ServiceState.UNHEALTHY, ServiceState.FAILED}
_OVER = {ServiceState.ENDED, ServiceState.FAILED, ServiceState.STOPPED}
_READ_INTERVAL_S = 0.1


class ServiceScreen:
    """Shows the states of the services and, with `logs`, the new lines of their logs.

    On a terminal that can redraw, the states stand below the lines and change in place; elsewhere each change
    is a line. The logs are read from their files at short intervals: the services write them without us, so
    that a slow terminal can never hold up an experiment.
    """

    def __init__(self, console: Console, services: Iterable[str], logs: Path | None) -> None:
        self.states = dict.fromkeys(services, ServiceState.WAITING)
        self._console = console
        self._logs = logs
        self._readers: dict[str, LogReader] = {}
        self._styles = dict(zip(self.states, itertools.cycle(_COLOURS), strict=False))
        self._width = max(map(len, self.states), default=0)
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._follower = threading.Thread(target=self._follow, name="follow logs", daemon=True)
        self._live = (
            Live(console=console, get_renderable=self._status) if console.is_interactive else nullcontext()
        )

    def __enter__(self) -> Self:
        self._live.__enter__()
        self._follower.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._over.set()
        self._follower.join()
        self._live.__exit__(None, None, None)

    def show(self, service: str, state: ServiceState) -> None:
        """Take in a new state of a service."""
        with self._lock:
            if self._logs is not None and state is ServiceState.STARTED:
                self._readers[service] = LogReader(self._logs / f"{service}.log")
            if state in _OVER:
                self._print_new_lines(service, all_of_it=True)
            self.states[service] = state
            if not self._console.is_interactive:
                self._console.print(f"{service}: {state}")

    def _follow(self) -> None:
        try:
            while not self._over.wait(_READ_INTERVAL_S):
                with self._lock:
                    for service in self._readers:
                        self._print_new_lines(service, all_of_it=False)
        except SystemExit:  # rich's, where nobody reads our output any more; it would end this thread alone
            os.kill(os.getpid(), signal.SIGTERM)

    def _print_new_lines(self, service: str, *, all_of_it: bool) -> None:
        if service in self._readers:
            for line in self._readers[service].new_lines(all_of_it=all_of_it):
                prefix = Text(f"{service:{self._width}} | ", style=self._styles[service])
                self._console.print(prefix + Text.from_ansi(line))

    def _status(self) -> Text:
        lines = Text()
        for service, state in self.states.items():
            lines.append(f"{service:{self._width}}  ", self._styles[service])
            lines.append(f"{state}\n", "red" if state in _BAD else "")
        return lines
