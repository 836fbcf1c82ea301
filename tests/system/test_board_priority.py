"""A board process and its real-time priority."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conftest import Network

PROGRAM = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(2))"


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has it")
def test_a_board_runs_before_other_processes_and_its_computations_after_its_clock(network: Network) -> None:
    if subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, check=False).returncode:
        pytest.skip("this user may not have real-time priority")
    board = network.board.pid
    assert (os.sched_getscheduler(board), os.sched_getparam(board).sched_priority) == (os.SCHED_FIFO, 2)
    threads = [int(thread.name) for thread in Path(f"/proc/{board}/task").iterdir()]
    preferred = [thread for thread in threads if os.sched_getscheduler(thread) == os.SCHED_FIFO]
    assert {os.sched_getparam(thread).sched_priority for thread in preferred} == {1, 2}
