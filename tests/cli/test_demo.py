"""`reconros demo`, when it is interrupted: the report has what was measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
import typer

from reconros_zenoh.cli import demo as command
from reconros_zenoh.experiments import roundtrip_virtual, roundtrip_wall

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

IN_VIRTUAL_TIME = roundtrip_virtual.run_virtual


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def interrupt_first_mapping(plan: Any, report: Any, on_progress: Callable[[str, str], None]) -> None:
    def progress(mapping: str, client: str) -> None:
        on_progress(mapping, client)
        if client == "sobel":
            raise KeyboardInterrupt

    IN_VIRTUAL_TIME(plan, report, progress)


@pytest.fixture(autouse=True)
def _without_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(roundtrip_wall, "run_wall", IN_VIRTUAL_TIME)


def run_demo(out: Path) -> int:
    with pytest.raises(typer.Exit) as ended:
        command.demo(out, wall_requests=3, virtual_requests=3)
    return ended.value.exit_code


def test_in_its_second_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(roundtrip_virtual, "run_virtual", interrupt_first_mapping)
    assert run_demo(tmp_path) == 130
    *_, report, end = capsys.readouterr().out.splitlines()
    assert (report, end) == (f"report: {tmp_path / 'report.html'}", "interrupted before its end")
    page = (tmp_path / "report.html").read_text()
    assert "<h2>roundtrip, wall clock</h2>" in page
    assert page.count("The run was interrupted: its last mapping ended early.") == 1
    assert page.index("<h2>roundtrip, virtual clock</h2>") < page.index("The run was interrupted")


def test_before_the_second_part_has_measured_anything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(roundtrip_virtual, "run_virtual", interrupt)
    assert run_demo(tmp_path) == 130
    page = (tmp_path / "report.html").read_text()
    assert "<h2>roundtrip, wall clock</h2>" in page
    assert "<h2>roundtrip, virtual clock</h2>" not in page


def test_while_it_finds_out_what_each_mechanism_is_worth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "ablate", interrupt)
    assert run_demo(tmp_path) == 130
    page = (tmp_path / "report.html").read_text()
    assert "<h2>roundtrip, virtual clock</h2>" in page
    assert "What each mechanism of the model is worth" not in page
    assert "The run was interrupted" not in page


def test_before_anything_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(roundtrip_wall, "run_wall", interrupt)
    assert run_demo(tmp_path) == 130
    assert capsys.readouterr().out.splitlines()[-1] == "interrupted before anything was measured"
    assert not (tmp_path / "report.html").exists()
