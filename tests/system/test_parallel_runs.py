"""Runs in several processes: none outlives the one that started them, and their mistakes are told."""

from __future__ import annotations

import subprocess
import sys
from signal import SIG_BLOCK, SIGHUP, SIGINT, SIGKILL, SIGTERM, Signals, pthread_sigmask

import psutil
import pytest
from processes import LIMIT_S, Process

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.errors import FileError
from reconros_zenoh.experiments.parallel import ParallelRuns, Run
from reconros_zenoh.experiments.roundtrip import application_folder

PROGRAM = """
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.experiments.parallel import ParallelRuns, Run
from reconros_zenoh.experiments.roundtrip import application_folder

if __name__ == "__main__":
    mapping = application_folder() / "mappings" / "mixed.toml"
    runs = [Run(read_profile("miniitx-zynq7100"), mapping, 20, seed) for seed in range(500)]
    with ParallelRuns() as parallel:
        for _ in parallel.records(runs):
            print("made a run")
"""


@pytest.mark.parametrize("number", [SIGINT, SIGTERM, SIGKILL], ids=lambda number: number.name)
def test_no_process_outlives_the_one_that_started_it(number: Signals) -> None:
    with Process(program=("-c", PROGRAM)) as process:
        process.wait_for("made a run")
        children = psutil.Process(process.pid).children(recursive=True)
        assert len(children) >= 2
        process.end(number)
        assert not psutil.wait_procs(children, timeout=LIMIT_S)[1]


INTERRUPTED_AS_IT_STARTS = """
import os, signal
from multiprocessing import get_context
from reconros_zenoh.experiments.interruption import terminal_signals_blocked

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


def test_processes_that_make_runs_leave_the_signals_of_a_terminal_to_the_one_that_started_them() -> None:
    mapping = application_folder() / "mappings" / "mixed.toml"
    with ParallelRuns() as parallel:
        list(parallel.records([Run(read_profile("miniitx-zynq7100"), mapping, 1, 0)]))
        assert parallel._pool.submit(pthread_sigmask, SIG_BLOCK, ()).result() >= {SIGINT, SIGHUP}


def test_a_mistake_in_a_run_is_told_as_what_it_is() -> None:
    mapping = application_folder() / "mappings" / "mixed.toml"
    runs = [Run(read_profile("zcu104"), mapping, 20, 0)]
    with ParallelRuns() as parallel, pytest.raises(FileError, match="'zcu104' has no times for callback"):
        list(parallel.records(runs))
