"""`down` asks who runs the deployment to stop, once, whoever ran it before or wants it stopped too."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from deploy import state
from deploy.state import StateFolder
from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator

    Popen = subprocess.Popen[str]

PRELUDE = """
import os, signal, sys
from pathlib import Path
from deploy.state import StateFolder
folder = StateFolder(Path("compose.yaml"), {"XDG_STATE_HOME": os.getcwd()})
signals = []
signal.signal(signal.SIGTERM, lambda number, _: signals.append(number))
"""
# Each ends at the end of its input, and says how many signals it has got until then.
FORMER = """
with folder.claimed():
    pass
print("left", flush=True)
sys.stdin.read()
print(len(signals))
"""
OWNER = """
def leave(states, error):
    print("locked", flush=True)
    sys.stdin.read()
    StateFolder.leave(folder, {"signals": len(signals)}, error)
folder.leave = leave
with folder.claimed():
    pass
"""
DOWN = """
record = folder.end_owner()
print(record and record.states)
"""


@contextmanager
def process(folder: Path, program: str, first_line: str = "") -> Iterator[Popen]:
    """Yield a process that runs this program, when it has printed its first line."""
    with subprocess.Popen(
        [sys.executable, "-c", PRELUDE + program],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as started:
        try:
            assert started.stdout is not None
            assert not first_line or started.stdout.readline() == f"{first_line}\n"
            yield started
        finally:
            started.kill()


def wait_for_waiting(folder: Path, *processes: Popen) -> None:
    """Return when all of the processes wait for a lock of the folder."""
    (lock,) = folder.glob("reconros/*/lock")
    while True:
        locks = Path("/proc/locks").read_text().splitlines()
        waiting = [line for line in locks if "->" in line and f":{lock.stat().st_ino} " in line]
        if len(waiting) == len(processes):
            return
        assert all(each.poll() is None for each in processes)


def ended(started: Popen) -> str:
    return started.communicate(timeout=60)[0]


def test_who_has_the_lock_is_stopped_and_not_who_had_it_before(tmp_path: Path) -> None:
    with process(tmp_path, FORMER, "left") as former, process(tmp_path, OWNER, "locked") as owner:
        with process(tmp_path, DOWN) as down:
            wait_for_waiting(tmp_path, down)
            ended(owner)
            assert ended(down) == "{'signals': 1}\n"
        assert ended(former) == "0\n"


def test_of_two_downs_at_once_one_asks_to_stop_and_tells_what_has_ended(tmp_path: Path) -> None:
    with (
        process(tmp_path, FORMER, "left"),
        process(tmp_path, OWNER, "locked") as owner,
        process(tmp_path, DOWN) as one,
        process(tmp_path, DOWN) as other,
    ):
        wait_for_waiting(tmp_path, one, other)
        ended(owner)
        assert sorted((ended(one), ended(other))) == ["None\n", "{'signals': 1}\n"]


def test_what_runs_elsewhere_is_not_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = StateFolder(tmp_path / "compose.yaml", {"XDG_STATE_HOME": str(tmp_path)})
    with folder.claimed():
        pass
    # What the kernel says of a process of another host (NFS), and of one in another container.
    for number in (-1, 0):
        monkeypatch.setattr(state, "_owner", lambda _, number=number: number)
        with pytest.raises(UsageError, match="is up on another host or in a container"):
            folder.end_owner()
