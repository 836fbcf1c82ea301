"""Real-time priority for processes that keep a clock, where the user may have it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from reconros_zenoh.clock.priority import prefer_this_process, yield_to_clock

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has these calls")

PROGRAM = """\
import os
import threading
from reconros_zenoh.board.thread_pool import ThreadPool
from reconros_zenoh.clock.priority import prefer_this_process

def priority():
    return os.sched_getscheduler(0) == os.SCHED_FIFO, os.sched_getparam(0).sched_priority

prefer_this_process()
print(*priority())
thread = threading.Thread(target=lambda: print(*priority()))
thread.start()
thread.join()
print(*ThreadPool(1, "computation").submit(priority).result())
"""


class Scheduler:
    """Stands in for the calls of the operating system that ask for and set priorities."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, policy: int, priority: int = 0) -> None:
        self.refuses = False
        self.asked: list[tuple[int, int, int]] = []
        monkeypatch.setattr(os, "sched_getscheduler", lambda _: policy)
        monkeypatch.setattr(os, "sched_getparam", lambda _: os.sched_param(priority))
        monkeypatch.setattr(os, "sched_setscheduler", self._set)

    def _set(self, process: int, policy: int, parameters: os.sched_param) -> None:
        self.asked.append((process, policy, parameters.sched_priority))
        if self.refuses:
            raise PermissionError


def test_a_process_that_keeps_a_clock_asks_to_run_before_others(monkeypatch: pytest.MonkeyPatch) -> None:
    scheduler = Scheduler(monkeypatch, os.SCHED_OTHER)
    prefer_this_process()
    assert scheduler.asked == [(0, os.SCHED_FIFO, 2)]


def test_a_user_who_may_not_ask_for_that_goes_on_without(monkeypatch: pytest.MonkeyPatch) -> None:
    scheduler = Scheduler(monkeypatch, os.SCHED_OTHER)
    scheduler.refuses = True
    prefer_this_process()
    assert len(scheduler.asked) == 1


def test_a_priority_that_the_user_has_given_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    scheduler = Scheduler(monkeypatch, os.SCHED_RR, 7)
    prefer_this_process()
    assert scheduler.asked == []


@pytest.mark.parametrize(("own", "lower"), [(2, 1), (50, 49), (1, 1)])
def test_a_computation_goes_behind_the_clock(monkeypatch: pytest.MonkeyPatch, own: int, lower: int) -> None:
    scheduler = Scheduler(monkeypatch, os.SCHED_FIFO, own)
    yield_to_clock()
    assert scheduler.asked == [(0, os.SCHED_FIFO, lower)]


def test_a_computation_without_such_a_priority_keeps_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    scheduler = Scheduler(monkeypatch, os.SCHED_OTHER)
    yield_to_clock()
    assert scheduler.asked == []


def test_threads_of_a_preferred_process_are_preferred_and_computations_a_little_less() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    process, thread, computation = done.stdout.splitlines()
    if process == "False 0":
        pytest.skip("this user may not have real-time priority")
    assert [process, thread, computation] == ["True 2", "True 2", "True 1"]
