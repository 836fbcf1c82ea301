"""How far an experiment is, on terminals of all kinds."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from reconros_zenoh.cli.progress import ExperimentProgress, run_bar
from reconros_zenoh.experiments.roundtrip import CLIENTS, Plan

BAR = "\N{BOX DRAWINGS HEAVY HORIZONTAL}"


class Stream(io.StringIO):
    def __init__(self, *, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


kinds = pytest.mark.parametrize("kind", ["dumb", "file", "xterm"])


def stderr_of(kind: str, monkeypatch: pytest.MonkeyPatch) -> Stream:
    """Replace stderr for the rest of the test, with that of a terminal or with a file."""
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "dumb" if kind == "dumb" else "xterm")
    stream = Stream(terminal=kind != "file")
    monkeypatch.setattr("sys.stderr", stream)
    return stream


@kinds
def test_what_cannot_redraw_gets_lines(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stderr = stderr_of(kind, monkeypatch)
    plan = Plan("virtual", {"mixed": Path("mixed.toml")}, 1, 0, "native", Path())
    with ExperimentProgress(plan, quiet=False) as progress:
        for client in CLIENTS:
            progress.advance("mixed", client)
    lines = ["virtual time, mixed: 5 round trips ...", "virtual time, mixed: done"]
    shown = stderr.getvalue()
    if kind == "xterm":
        assert BAR in shown
        assert lines[0] not in shown
    else:
        assert shown.splitlines() == lines


@pytest.mark.parametrize(("runs", "each"), [(1, "1 request"), (2, "2 requests")])
@kinds
def test_what_cannot_redraw_gets_a_line_for_a_row_of_runs(
    kind: str, runs: int, each: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stderr = stderr_of(kind, monkeypatch)
    with run_bar("virtual time", runs, quiet=False, each="request") as advance:
        for _ in range(runs):
            advance()
    shown = stderr.getvalue()
    if kind == "xterm":
        assert BAR in shown
        assert "..." not in shown
    else:
        assert shown == f"virtual time: {each} ...\n"


def test_what_is_quiet_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    stderr = stderr_of("file", monkeypatch)
    with run_bar("virtual time", 2, quiet=True) as advance:
        advance()
    assert stderr.getvalue() == ""
