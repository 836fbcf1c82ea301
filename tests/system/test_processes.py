"""Processes of an experiment: they leave Ctrl-C to the one that started them, and end with it."""

from __future__ import annotations

import os
import subprocess
import sys
from signal import SIG_BLOCK, SIGHUP, SIGINT, SIGSTOP, pthread_sigmask
from typing import TYPE_CHECKING

import psutil
import pytest
from processes import LIMIT_S

from reconros_zenoh.errors import ExperimentError
from reconros_zenoh.experiments.processes import Processes, commands, receive, send

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from pathlib import Path

INTERRUPTED_AS_IT_STARTS = """
import os, signal
from multiprocessing import get_context
from reconros_zenoh.experiments.processes import terminal_signals_blocked

with terminal_signals_blocked():
    process = get_context("spawn").Process(target=abs, args=(1,))
    process.start()
os.kill(process.pid, signal.SIGINT)
process.join()
print(process.exitcode, signal.pthread_sigmask(signal.SIG_BLOCK, ()))
"""


def test_a_process_does_not_hear_ctrl_c_while_it_starts() -> None:
    command = [sys.executable, "-c", INTERRUPTED_AS_IT_STARTS]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    assert (done.stdout, done.stderr) == ("0 set()\n", "")


def tell_signal_mask(connection: Connection) -> None:
    connection.send(pthread_sigmask(SIG_BLOCK, ()))


def test_they_leave_the_signals_of_a_terminal_to_the_one_that_started_them() -> None:
    with Processes(grace_s=0) as processes:
        assert processes.start(tell_signal_mask).recv() >= {SIGINT, SIGHUP}


def stop(connection: Connection) -> None:
    connection.send(os.getpid())
    os.kill(os.getpid(), SIGSTOP)


def test_those_that_are_stopped_are_killed() -> None:
    with Processes(grace_s=0.1) as processes:
        numbers = [processes.start(stop).recv() for _ in range(2)]
    assert not any(map(psutil.pid_exists, numbers))


def write_at_the_end(connection: Connection, path: Path) -> None:
    connection.send("ready")
    list(commands(connection))
    path.write_text("done")


def test_they_end_by_themselves_when_the_block_ends(tmp_path: Path) -> None:
    with Processes(grace_s=LIMIT_S) as processes:
        assert receive(processes.start(write_at_the_end, tmp_path / "end")) == "ready"
    assert (tmp_path / "end").read_text() == "done"


def end_at_once(_: Connection) -> None:
    pass


def test_one_that_has_ended_is_told() -> None:
    with Processes(grace_s=0) as processes:
        connection = processes.start(end_at_once)
        with pytest.raises(ExperimentError, match="ended early"):
            receive(connection)
        with pytest.raises(ExperimentError, match="ended early"):
            send(connection, "anything")
