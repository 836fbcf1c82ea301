"""`reconros new`, `check` and `run` as processes, and a project's messages on the wire."""

from __future__ import annotations

import json
import signal
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from processes import LIMIT_S, Process, run

from reconros_zenoh.project.loader import load_project
from reconros_zenoh.rmw.node import Context

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Network


def test_a_new_project_runs_on_the_wall_clock_for_some_time(network: Network, tmp_path: Path) -> None:
    folder = tmp_path / "blink"
    assert run("new", folder).returncode == 0
    done = run("run", folder, "--router", network.endpoint, "--name", "blink", "--seconds", "0.5", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    status = json.loads(done.stdout)
    assert (status["board"], status["profile"]) == ("blink", "native")
    assert status["callbacks"]["count"]["calls"] >= 1


def test_what_a_project_publishes_is_heard_until_ctrl_c(network: Network, tmp_path: Path) -> None:
    folder = tmp_path / "blink"
    run("new", folder)
    heard: SimpleQueue[Any] = SimpleQueue()
    count = load_project(folder).types().message("blink_msgs/msg/Count")
    node = Context(network.transport, 0).node("listener", "/")
    node.subscription(count, "/count", heard.put)
    with Process("run", folder, "--router", network.endpoint, "--name", "blink") as board:
        first, second = (heard.get(timeout=LIMIT_S).message for _ in range(2))
        assert second.count == first.count + 1
        board.wait_for("serves blink under hardware on native")
        assert board.end(signal.SIGINT) == 0
        assert any(line.split()[:3] == ["0", "count", "1"] for line in board.out)
    node.close()


def test_mistakes_end_with_status_2_and_one_line(tmp_path: Path) -> None:
    run("new", tmp_path / "blink")
    (tmp_path / "blink" / "callbacks.py").write_text("def (:\n", encoding="utf-8")
    path = tmp_path / "build.cfg"
    path.write_bytes(b"[General]\nName = x\n\xff\xfe\x00\n")
    for arguments, place in (
        (("run", tmp_path / "blink", "--clock", "virtual"), "callbacks.py:1: SyntaxError"),
        (("check", path), f"{path}:3: "),
        (("check", tmp_path / "nothing"), f"{tmp_path / 'nothing'}: cannot be read"),
        (("new", tmp_path / "Blink"), "'Blink' cannot name a project"),
    ):
        done = run(*arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("reconros: ")
        assert place in done.stderr
        assert done.stderr.count("\n") == 1
