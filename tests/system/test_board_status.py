"""`reconros status` and what it is made of."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from processes import run

from reconros_zenoh.board.control import ask_status
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
