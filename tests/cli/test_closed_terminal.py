"""A terminal that closes takes nothing with it but itself."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.clock.signals import ENDING, ending_signals

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CLOSES_WHILE_IT_RUNS = """
import os, pathlib, sys
terminal, end = os.openpty()
for stream in (1, 2):
    os.dup2(end, stream)
import reconros_zenoh.cli.main as cli
def _application(verbs):
    assert sys.stdout.isatty()
    os.close(terminal)
    def command(**_):
        for stream in (sys.stdout, sys.stderr):
            print("measured", file=stream, flush=True)
        pathlib.Path(sys.argv[1]).write_text("all that was measured")
    return command
cli._application = _application
cli.main()
"""


def test_a_command_whose_terminal_closes_writes_what_it_has(tmp_path: Path) -> None:
    record = tmp_path / "record"
    done = subprocess.run(
        [sys.executable, "-c", CLOSES_WHILE_IT_RUNS, record], timeout=120, check=False, capture_output=True
    )
    assert done.returncode == 0
    assert record.read_text(encoding="utf-8") == "all that was measured"


@pytest.fixture
def _hangup_as_before() -> Iterator[None]:
    before = signal.getsignal(signal.SIGHUP)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("_hangup_as_before")
def test_what_nohup_starts_goes_on_when_its_terminal_closes() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    assert ending_signals() == ENDING
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    assert ending_signals() == (signal.SIGINT, signal.SIGTERM)
