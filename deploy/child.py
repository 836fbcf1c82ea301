"""A command as a local process in a session of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    import signal
    from collections.abc import Callable, Mapping, Sequence

_LAUNCH = Path(__file__).with_name("launch.py")


class Child:
    """A started process, its session and process group; both streams go to `output`.

    `on_exit` is called with the child and its exit status (negative: the signal) in a thread of this child.
    Thread rule: make a Child in a thread that lives at least as long, because the kernel counts the end of
    the *thread* that started a process as the death of its parent (launch.py).
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        output: BinaryIO,
        on_exit: Callable[[Child, int], None],
    ) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", _LAUNCH, str(os.getpid()), *local_command(command)],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        threading.Thread(
            target=lambda: on_exit(self, self._process.wait()), name=f"wait for {command[0]}", daemon=True
        ).start()

    def send_signal(self, number: signal.Signals) -> None:
        """Send the signal to every process of the group; nothing happens when none is left."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)


def local_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables with the running Python's scripts first in PATH and its output unbuffered.

    Unbuffered, so that a log is complete up to the moment in which its service dies.
    """
    scripts = str(Path(sys.executable).parent)
    path = environment.get("PATH", os.defpath)
    return {"PYTHONUNBUFFERED": "1", **environment, "PATH": f"{scripts}{os.pathsep}{path}"}


def local_command(command: Sequence[str]) -> list[str]:
    """Return the command with `reconros` and `python` taken from the running virtual environment."""
    match command:
        case ["reconros", *arguments]:
            return [sys.executable, "-m", "reconros_zenoh", *arguments]
        case ["python" | "python3", *arguments]:
            return [sys.executable, *arguments]
    return list(command)
