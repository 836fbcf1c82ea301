"""The gateway experiment with real bytes between real processes: that it runs, checks and cleans up."""

from __future__ import annotations

import itertools
import json
import multiprocessing
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from reconros_zenoh.errors import ExperimentError
from reconros_zenoh.experiments.gateway_native import Setup, take_turns
from reconros_zenoh.experiments.gateway_processes import Receiver
from reconros_zenoh.experiments.processes import Processes

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from pathlib import Path


def test_one_cell_between_processes(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "reconros_zenoh", "experiment", "gateway", "--profile", "native"]
    options = ["--sizes", "300kB", "--subscribers", "2", "--repeat", "2", "--json", "--out", str(tmp_path)]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    (cell,) = result["cells"]
    assert (cell["publisher"], cell["size"], cell["subscribers"]) == ("software", 300_000, 2)
    for variant in ("smt", "gateway"):
        assert cell[variant]["hw_max_ms"] > 0
        assert cell[variant]["sw_ms"] > 0
    assert result["statistic"] == "median"
    assert any("read-only view" in line for line in result["copies"])


@pytest.mark.parametrize("options", [["--clock", "virtual"], ["--publisher", "hardware"]])
def test_the_native_profile_is_real_time_and_software(options: list[str], tmp_path: Path) -> None:
    command = [sys.executable, "-m", "reconros_zenoh", "experiment", "gateway", "--profile", "native"]
    done = subprocess.run(
        [*command, *options, "--out", str(tmp_path)], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2
    assert done.stderr == ("reconros: profile native runs in real time, with the publisher in software.\n")


def test_a_receiver_reports_when_all_its_readers_have_a_message_and_checks_the_bodies() -> None:
    here, there = multiprocessing.Pipe()
    receiver = Receiver(there, 2)
    body = np.frombuffer(b"123456789", np.uint8)

    def image(number: int, crc: str) -> Any:
        class Stamp:
            sec = nanosec = 0

        class Header:
            stamp = Stamp
            frame_id = f"{number} {crc}"

        class Image:
            header = Header
            data = body

        return Image

    receiver.note("a", image(1, "cbf43926"))  # lost to b
    receiver.note("a", image(2, "cbf43926"))
    assert not here.poll()
    receiver.note("b", image(2, "cbf43926"))
    assert [(name, number) for name, number, _ in here.recv()] == [("a", 2), ("b", 2)]
    receiver.check()
    assert here.recv() == ""
    receiver.note("a", image(3, "00000000"))
    receiver.note("b", image(3, "00000000"))
    assert here.recv()
    receiver.check()
    assert here.recv() == "2 of 2 messages came with other bytes."


def test_too_many_lost_messages_end_the_experiment() -> None:
    class Losing:
        def measure(self) -> None:
            return None

    with pytest.raises(ExperimentError, match="x: 3 of 3 messages were lost"):
        take_turns(lambda _: {"x": Losing()}, 3)  # type: ignore[dict-item] # all of a setup that it needs


def receive(connection: Connection) -> None:
    """Be a receiver that notes every message."""
    connection.send("ready")
    for number in itertools.count(1):
        connection.send([("hardware_0", number, 1), ("software", number, 1)])
        connection.recv()
        connection.send("")


def publish(connection: Connection, messages: int) -> None:
    """Be a source that dies after so many messages."""
    for _ in range(messages):
        connection.recv()


@pytest.mark.parametrize("messages", [0, 5, 7])
def test_a_process_that_dies_ends_the_experiment_with_a_reason(messages: int) -> None:
    def measure() -> None:
        with Processes(1.0) as processes:
            setup = Setup(processes, [(receive, ())], (publish, (messages,)))
            while True:
                setup.measure()

    with pytest.raises(ExperimentError, match="ended early"):
        measure()
