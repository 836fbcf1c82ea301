"""Runs in several processes: none outlives the one that started them, and their mistakes are told."""

from __future__ import annotations

from multiprocessing import active_children
from signal import SIGINT, SIGKILL, SIGTERM, Signals

import psutil
import pytest
from processes import LIMIT_S, Process

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.errors import ExperimentError, FileError
from reconros_zenoh.experiments.parallel import ParallelRuns, Run
from reconros_zenoh.experiments.roundtrip import application_folder

MIXED = application_folder() / "mappings" / "mixed.toml"

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


def test_those_that_are_stopped_keep_nobody_from_the_end() -> None:
    with Process(program=("-c", PROGRAM)) as process:
        process.wait_for("made a run")
        children = psutil.Process(process.pid).children()
        try:
            for child in children:
                if "spawn_main" in " ".join(child.cmdline()):  # not the resource tracker
                    child.suspend()
            process.end(SIGINT)
            assert not psutil.wait_procs(children, timeout=LIMIT_S)[1]
        finally:
            for child in children:
                if child.is_running():
                    child.kill()


def test_a_mistake_in_a_run_is_told_as_what_it_is() -> None:
    runs = [Run(read_profile("zcu104"), MIXED, 20, 0)]
    with ParallelRuns() as parallel, pytest.raises(FileError, match="'zcu104' has no times for callback"):
        list(parallel.records(runs))


def test_a_process_that_is_ended_from_outside_ends_the_runs_with_a_reason() -> None:
    runs = [Run(read_profile("miniitx-zynq7100"), MIXED, 1, seed) for seed in range(500)]
    with ParallelRuns() as parallel:
        records = parallel.records(runs)
        next(records)
        for process in active_children():
            process.kill()
        with pytest.raises(ExperimentError, match="was there memory enough"):
            list(records)


def test_what_others_left_unread_is_not_taken_for_a_record() -> None:
    profile = read_profile("miniitx-zynq7100")
    with ParallelRuns() as parallel:
        left = parallel.records([Run(profile, MIXED, requests, 0) for requests in (1, 2, 3, 4)])
        next(left)
        (record,) = parallel.records([Run(profile, MIXED, 5, 0)])
        assert record["inverse"].values_ms.size == 5
