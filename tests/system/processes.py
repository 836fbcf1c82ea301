"""The commands of this project as processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from threading import Condition, Event, Thread
from typing import IO, TYPE_CHECKING, Self

if TYPE_CHECKING:
    from collections.abc import Callable

LIMIT_S = 60
_OURS = {"RECONROS_ROUTER", "ROS_DOMAIN_ID"}
RECONROS = ("-m", "reconros_zenoh")


def wait_until(condition: Callable[[], bool]) -> None:
    """Return when the condition, which is looked at every 50 ms, holds."""
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end
        Event().wait(0.05)


def _environment() -> dict[str, str]:
    """Return the variables without those that our commands read; messages are not broken into short lines."""
    given = {name: value for name, value in os.environ.items() if name not in _OURS}
    return {**given, "PYTHONUNBUFFERED": "1", "COLUMNS": "200"}


def run(*arguments: object, program: tuple[str, ...] = RECONROS) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; `program` is what Python is to run."""
    return subprocess.run(
        [sys.executable, *program, *map(str, arguments)],
        env=_environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )


class Process:
    """A command while it runs; `out` and `err` hold the lines it has written so far.

    The end of the context ends it, by force if it takes too long.
    """

    def __init__(self, *arguments: object, program: tuple[str, ...] = RECONROS) -> None:
        self._popen = subprocess.Popen(
            [sys.executable, *program, *map(str, arguments)],
            env=_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.pid = self._popen.pid
        self.out: list[str] = []
        self.err: list[str] = []
        self._changed = Condition()
        self._open_streams = 2
        assert self._popen.stdout is not None
        assert self._popen.stderr is not None
        self._readers = [
            Thread(target=self._read, args=(stream, lines), daemon=True)
            for stream, lines in ((self._popen.stdout, self.out), (self._popen.stderr, self.err))
        ]
        for reader in self._readers:
            reader.start()

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._popen.poll() is None

    def wait_for(self, *words: str) -> None:
        """Return when it has written a line with all these words, on either stream."""
        with self._changed:
            assert self._changed.wait_for(lambda: self.count(*words) or not self._open_streams, LIMIT_S), self
            assert self.count(*words), self

    def count(self, *words: str) -> int:
        """Return how many lines with all these words it has written."""
        return sum(all(word in line for word in words) for line in (*self.out, *self.err))

    def end(self, number: signal.Signals | None = None) -> int:
        """Return its exit status once it has ended and all its lines are read, after this signal if given."""
        if number is not None:
            self._popen.send_signal(number)
        status = self._popen.wait(LIMIT_S)
        for reader in self._readers:
            reader.join()
        return status

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._popen.send_signal(signal.SIGTERM)
            self._popen.wait(10)
        except subprocess.TimeoutExpired:
            self._popen.kill()
        self.end()

    def __repr__(self) -> str:
        return "\n".join([" ".join(self._popen.args), *self.out, *self.err])  # type: ignore[arg-type] # strings

    def _read(self, stream: IO[str], lines: list[str]) -> None:
        with stream:
            for line in stream:
                with self._changed:
                    lines.append(line.rstrip("\n"))
                    self._changed.notify_all()
        with self._changed:
            self._open_streams -= 1
            self._changed.notify_all()
