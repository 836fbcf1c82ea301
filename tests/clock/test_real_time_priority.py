"""The loop of a board goes before all other threads of its host, where that is allowed."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux has these policies")

POLICIES = """
import os, resource, threading
from reconros_zenoh.clock.process import real_time_priority

def policy():
    number = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    return {os.SCHED_OTHER: "normal", os.SCHED_BATCH: "batch", os.SCHED_FIFO: "first"}[number]

def of_a_new_thread():
    seen = []
    thread = threading.Thread(target=lambda: seen.append(policy()))
    thread.start()
    thread.join()
    return seen[0]
"""
BATCH = """
os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
"""
FORBID = """
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
if os.geteuid() == 0:
    os.setuid(65534)
"""
ALLOWED = """
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    print("allowed")
except PermissionError:
    print("forbidden")
"""
USE = """
print(policy())
with real_time_priority():
    print(policy(), of_a_new_thread())
print(policy(), of_a_new_thread())
"""
TOLD = """
from reconros_zenoh.clock.wall import WallEnvironment

def told():
    environment = WallEnvironment()
    environment.run(until=environment.timeout(1))
    return environment.has_real_time_priority

with real_time_priority():
    print(told())
print(told())
"""


def output(*parts: str) -> list[str]:
    done = subprocess.run([sys.executable, "-c", "".join(parts)], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_a_thread_has_it_meanwhile_and_those_that_it_starts_have_not() -> None:
    if output(POLICIES, ALLOWED) != ["allowed"]:
        pytest.skip("this user may not have real-time priorities")
    assert output(POLICIES, USE) == ["normal", "first", "normal", "normal", "normal"]
    assert output(POLICIES, BATCH, USE) == ["batch", "first", "normal", "batch", "batch"]
    assert output(POLICIES, TOLD) == ["True", "False"]


def test_where_it_is_forbidden_all_stays_as_it_was() -> None:
    assert output(POLICIES, FORBID, ALLOWED) == ["forbidden"]
    assert output(POLICIES, FORBID, USE) == ["normal"] * 5
    assert output(POLICIES, FORBID, BATCH, USE) == ["batch"] * 5
    assert output(POLICIES, FORBID, TOLD) == ["False"] * 2
