"""Ctrl-C while an experiment writes what it has measured: the writing goes on to its end."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING, Any

import pytest
from typer.testing import CliRunner

from reconros_zenoh.cli import demo, experiment, gateway_experiment, simulate, tables
from reconros_zenoh.cli.main import _application
from reconros_zenoh.clock.signals import EndingHandler
from reconros_zenoh.experiments import ablation, roundtrip_virtual, roundtrip_wall
from reconros_zenoh.experiments.deployment import DeploymentRun
from reconros_zenoh.experiments.interruption import until_interrupted

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from typer.testing import Result


@pytest.fixture(autouse=True)
def _signals_of_a_command() -> Iterator[None]:
    former = signal.signal(signal.SIGINT, EndingHandler())
    yield
    signal.signal(signal.SIGINT, former)


def press_ctrl_c_in(monkeypatch: pytest.MonkeyPatch, owner: object, name: str) -> None:
    """Have a function of a module or class begin with Ctrl-C."""
    function = getattr(owner, name)

    def interrupted(*arguments: Any, **options: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        return function(*arguments, **options)

    monkeypatch.setattr(owner, name, interrupted)


def reconros(verb: str, *arguments: object) -> Result:
    return CliRunner().invoke(_application([verb]), [verb, *map(str, arguments)])


ROUND_TRIPS = ("experiment", "roundtrip", "--clock", "virtual", "--mapping", "mixed", "--requests", "3")
SIMULATION = ("simulate", "-f", "deploy/roundtrip.yaml", "--requests", "1")
GATEWAY = ("experiment", "gateway", "--sizes", "10kB", "--subscribers", "2", "--repeat", "1")


def files_in(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("command", "owner", "writing"),
    [
        (ROUND_TRIPS, experiment, "finish"),
        (ROUND_TRIPS, experiment, "write_grid"),
        (GATEWAY, gateway_experiment, "_write"),
        (SIMULATION, DeploymentRun, "write_records"),
        (SIMULATION, simulate, "_print_table"),
    ],
)
def test_what_was_measured_is_written_and_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...], owner: object, writing: str
) -> None:
    reference = reconros(*command, "--out", tmp_path / "a")
    press_ctrl_c_in(monkeypatch, owner, writing)
    result = reconros(*command, "--out", tmp_path / "b")
    assert result.exit_code == 0
    assert result.stdout == reference.stdout.replace(str(tmp_path / "a"), str(tmp_path / "b"))
    assert files_in(tmp_path / "b") == files_in(tmp_path / "a")


@pytest.mark.parametrize(
    ("table", "writing"), [("callbacks", "_show_callbacks"), ("reconfiguration", "_print_slots")]
)
def test_a_table_is_shown(monkeypatch: pytest.MonkeyPatch, table: str, writing: str) -> None:
    reference = reconros("experiment", table)
    press_ctrl_c_in(monkeypatch, tables, writing)
    result = reconros("experiment", table)
    assert (result.exit_code, result.output) == (0, reference.output)


def test_it_is_not_marked_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    press_ctrl_c_in(monkeypatch, experiment, "finish")
    assert reconros(*ROUND_TRIPS, "--out", tmp_path).exit_code == 0
    assert json.loads((tmp_path / "virtual" / "experiment.json").read_text())["interrupted"] is False


@pytest.mark.parametrize("writing", ["show", "load_run"])
def test_demo_ends_before_its_next_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writing: str
) -> None:
    monkeypatch.setattr(roundtrip_wall, "run_wall", roundtrip_virtual.run_virtual)
    press_ctrl_c_in(monkeypatch, demo, writing)
    result = reconros("demo", "--wall-requests", 3, "--out", tmp_path)
    assert result.exit_code == 130
    *_, report, end = result.stdout.splitlines()
    assert (report, end) == (f"report: {tmp_path / 'report.html'}", "interrupted before its end")
    page = (tmp_path / "report.html").read_text()
    assert "<h2>roundtrip, wall clock</h2>" in page
    assert "<h2>roundtrip, virtual clock</h2>" not in page
    assert "The run was interrupted" not in page  # what is in it is complete


def test_demo_that_has_measured_all_writes_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(roundtrip_wall, "run_wall", roundtrip_virtual.run_virtual)
    monkeypatch.setattr(ablation, "MECHANISMS", {ablation.COMPLETE: {}})
    monkeypatch.setattr(demo, "_ABLATION_REQUESTS", 3)
    press_ctrl_c_in(monkeypatch, demo, "write_report")
    result = reconros("demo", "--wall-requests", 3, "--virtual-requests", 3, "--out", tmp_path)
    assert result.exit_code == 0
    assert (tmp_path / "report.html").exists()


def test_a_signal_after_a_block_within_another_waits_for_the_end_of_both() -> None:
    with until_interrupted() as outer:
        with until_interrupted() as inner:
            pass
        signal.raise_signal(signal.SIGINT)
    assert not inner.happened
    assert not outer.happened


def test_a_signal_in_a_block_ends_it_whatever_came_before() -> None:
    with until_interrupted():
        pass
    with until_interrupted() as interruption:
        signal.raise_signal(signal.SIGINT)
        pytest.fail("went on")
    assert interruption.happened


def test_where_no_command_has_taken_the_signals_none_is_held_back() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with until_interrupted():
        pass
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
