"""The driving example as processes."""

from __future__ import annotations

from importlib.resources import as_file, files
from signal import SIGINT
from typing import TYPE_CHECKING
from urllib.request import urlopen

from processes import Process, run

from reconros_zenoh.measure.record import read_record

if TYPE_CHECKING:
    from pathlib import Path


def test_a_board_drives_the_robot(endpoint: str, tmp_path: Path) -> None:
    with (
        as_file(files("reconros_zenoh.applications.driving")) as project,
        Process("router", "--listen", endpoint) as router,
    ):
        router.wait_for("router listens on", endpoint)
        with Process("board", project, "--router", endpoint) as board:
            board.wait_for("board board0 serves driving under default on zcu104")
            arguments = ("--router", endpoint, "--pictures", "5", "--out", tmp_path, "--view", "0")
            with Process("robot", *arguments) as robot:
                robot.wait_for("robot: ready, the pictures are at")
                with urlopen(robot.out[0].split()[-1]) as page:
                    assert b"<h1>what the robot sees</h1>" in page.read()
                assert robot.end() == 0, robot
            record = read_record(tmp_path / "robot.csv")
            # Whoever has just joined is not heard of everywhere, and of pictures only the newest is kept.
            answered = len(record.values_ms)
            assert answered > 0
            assert (answered + record.lost, record.wrong) == (5, 0)
            assert f"robot: 5 pictures published, {answered} answered" in robot.out
            assert robot.out[-1].startswith(
                "robot: at most 0 mm beside the middle of the lane; stood for 0.0 s"
            )
            with Process("robot", "--router", endpoint, "--pictures", "600") as robot:
                robot.wait_for("robot: ready")
                assert robot.end(SIGINT) == 130
            assert board.end(SIGINT) == 0, board
        assert (board.err, robot.err) == ([], [])


def test_a_robot_without_a_board_ends_with_status_2_and_one_line(endpoint: str) -> None:
    with Process("router", "--listen", endpoint) as router:
        router.wait_for("router listens on", endpoint)
        done = run("robot", "--router", endpoint, "--wait", "0.2")
    assert (done.returncode, done.stdout) == (2, "robot: ready\n")
    assert "nobody in domain 0 subscribed to /image_raw" in done.stderr
    assert done.stderr.count("\n") == 1
