"""The design example as processes."""

from __future__ import annotations

import json
from signal import SIGINT, SIGTERM
from typing import TYPE_CHECKING

import psutil
from processes import Process, run, wait_until

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Network


def test_both_variants_run_as_processes(tmp_path: Path) -> None:
    with Process(
        *("experiment", "design", "--clock", "wall", "--seconds", "2", "--json", "--out", tmp_path)
    ) as done:
        assert done.end() == 0, done
    experiment = json.loads("\n".join(done.out))
    assert done.err == []
    one, two = experiment["variants"]["one_slot"], experiment["variants"]["two_slots"]
    assert one["reconfigurations"] > two["reconfigurations"] == 2
    for name, variant in (("one_slot", one), ("two_slots", two)):
        assert variant["wrong"] == 0
        assert 0 < variant["frames_out"] <= variant["frames_in"] == 10
        for file in ("last.png", "filtered.gif", "filter.csv", "control.csv"):
            assert (tmp_path / "wall" / name / file).stat().st_size > 0
    assert (tmp_path / "wall" / "report.html").exists()


def test_an_interrupted_run_keeps_what_it_has(tmp_path: Path) -> None:
    record = tmp_path / "wall" / "one_slot" / "filter.csv"
    with Process(
        *("experiment", "design", "--clock", "wall", "--seconds", "600", "--json", "--out", tmp_path)
    ) as done:
        wait_until(lambda: record.exists() and ",ok\n" in record.read_text(encoding="ascii"))
        children = psutil.Process(done.pid).children(recursive=True)
        assert done.end(SIGTERM) == 130, done
    assert not psutil.wait_procs(children, timeout=10)[1]
    experiment = json.loads("\n".join(done.out))
    assert done.err == []
    assert experiment["interrupted"] is True
    (variant,) = experiment["variants"].values()
    assert variant["frames_out"] > 0
    assert variant["reconfigurations"] > 0
    assert variant["frames_in"] is None
    for name in ("experiment.json", "report.html", "one_slot/last.png"):
        assert (tmp_path / "wall" / name).stat().st_size > 0


def test_a_viewer_tells_where_its_page_is_and_ends_with_status_0(network: Network, tmp_path: Path) -> None:
    with Process("viewer", "--router", network.endpoint, "--view", "0", "--out", tmp_path) as viewer:
        viewer.wait_for("viewer: ready, the pictures are at http://127.0.0.1:")
        assert viewer.end(SIGINT) == 0
    assert viewer.out[-1] == "viewer: 0 filtered pictures and 0 servo indices came"
    assert viewer.err == []


def test_a_camera_ends_with_status_130_at_a_signal(network: Network) -> None:
    with Process("camera", "--router", network.endpoint, "--group", "pair", "--members", "2") as camera:
        camera.wait_for("camera: ready")
        assert camera.end(SIGTERM) == 130
    assert camera.out == ["camera: ready", "camera: 0 pictures published"]
    assert camera.err == []


def test_a_camera_without_a_board_ends_with_status_2_and_one_line(endpoint: str) -> None:
    with Process("router", "--listen", endpoint) as router:
        router.wait_for("router listens on", endpoint)
        done = run("camera", "--router", endpoint, "--wait", "0.2")
    assert (done.returncode, done.stdout) == (2, "camera: ready\n")
    assert "nobody in domain 0 subscribed to /image_raw" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_viewer_that_cannot_write_ends_with_status_2_and_one_line(network: Network) -> None:
    done = run("viewer", "--router", network.endpoint, "--out", "/dev/null/viewer")
    assert (done.returncode, done.stdout) == (2, "")
    assert "cannot be created" in done.stderr
    assert done.stderr.count("\n") == 1
