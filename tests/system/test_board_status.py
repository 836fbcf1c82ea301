"""`reconros status` and what it is made of."""

from __future__ import annotations

import json
import os
import signal
import sys
from typing import TYPE_CHECKING

import pytest
from processes import Process, run

from reconros_zenoh.board.control import ask_status
from reconros_zenoh.clock.process import real_time_priority
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from conftest import Network


def test_sessions_get_the_status_as_soon_as_they_are_open(network: Network) -> None:
    for _ in range(20):
        with ZenohTransport.open(network.endpoint) as transport:
            assert ask_status(transport, "board0")["board"] == "board0"


def test_the_command_prints_the_status_as_json(network: Network) -> None:
    done = run("status", "--router", network.endpoint, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    status = json.loads(done.stdout)
    assert (status["board"], status["domain"], status["executor"]) == ("board0", 0, "reconros")
    assert [slot["id"] for slot in status["slots"]] == [0, 1, 2, 3]
    assert {name: callback["slots"] for name, callback in status["callbacks"].items()} == {
        "inverse": [0],
        "mnist": [2, 3],
        "sobel": [2, 3],
        "sort": [1],
        "hash": [3],
    }


def test_a_board_that_is_not_there_is_named(network: Network) -> None:
    done = run("status", "board7", "--router", network.endpoint)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "reconros: no board named 'board7' answers. Start it with `reconros board --name board7`, "
        "or name one that runs: board0.\n"
    )


def test_a_board_that_is_stopped_is_there_and_does_not_answer(network: Network) -> None:
    with Process("board", "--router", network.endpoint, "--name", "board1") as board:
        board.wait_for("serves")
        assert run("status", "board1", "--router", network.endpoint).returncode == 0  # the router knows it
        os.kill(board.pid, signal.SIGSTOP)
        try:
            done = run("status", "board1", "--router", network.endpoint)
        finally:
            os.kill(board.pid, signal.SIGCONT)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("reconros: board 'board1' is running but does not answer")


def is_first(pid: int) -> bool:
    return os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO


def may_be_first() -> bool:
    with real_time_priority():
        return is_first(0)


@pytest.mark.skipif(sys.platform != "linux", reason="Linux has these policies")
@pytest.mark.parametrize(("profile", "has_times_to_keep"), [("miniitx-zynq7100", True), ("native", False)])
def test_the_loop_of_a_board_has_real_time_priority_where_it_may_and_has_a_model(
    network: Network, profile: str, has_times_to_keep: bool
) -> None:
    with Process("board", "--router", network.endpoint, "--name", "board1", "--profile", profile) as board:
        board.wait_for("serves")
        host = ask_status(network.transport, "board1")["host"]  # its loop runs
        assert is_first(board.pid) == (has_times_to_keep and may_be_first())
        assert host["real_time_priority"] == is_first(board.pid)
