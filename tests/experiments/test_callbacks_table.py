"""Table I on the board model: its times are those of the profile, and their parts add up."""

from __future__ import annotations

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from reconros_zenoh.applications.roundtrip.inputs import SAMPLE
from reconros_zenoh.board.profile import Profile, read_profile
from reconros_zenoh.cli.experiment import app
from reconros_zenoh.errors import ExperimentError, UsageError
from reconros_zenoh.experiments import callbacks
from reconros_zenoh.experiments.callbacks import TABLE_I, measure_callbacks, run_alone
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.project.loader import load_project

PROFILE = "miniitx-zynq7100"
# What goes through the MEMIF, both ways [B].
TRANSFERRED = {
    "sobel": 2 * 640 * 480 * 3,
    "sort": 2 * 2048 * 4,
    "mnist": 28 * 28 + 4,
    "inverse": 4 + 4,
    "hash": 1920 * 1080 * 3 + 32,
}
WALL_ONLY = (
    "elapsed_hardware_ms",
    "elapsed_software_ms",
    "host_kernel_ms",
    "host_affords_hardware",
    "host_affords_software",
)


def changed(**sections: dict[str, Any]) -> Profile:
    """The shipped profile with other sections of its model."""
    content = read_profile(PROFILE).model_dump()
    content["model"].update(sections)
    return Profile.model_validate(content)


@pytest.fixture(scope="module")
def table() -> dict[str, Any]:
    return measure_callbacks("virtual", read_profile(PROFILE), 2, lambda: None)


def test_the_callbacks_stand_in_the_order_of_the_paper(table: dict[str, Any]) -> None:
    assert list(table["callbacks"]) == ["sobel", "sort", "mnist", "inverse", "hash"]


@pytest.mark.parametrize("name", TABLE_I)
def test_the_time_in_hardware_is_compute_and_transfers_and_two_calls(
    table: dict[str, Any], name: str
) -> None:
    model = read_profile(PROFILE).model
    assert model is not None
    row = table["callbacks"][name]
    assert row["hardware"] == {
        "compute_ms": pytest.approx(model.callbacks[name].compute.ns / 1e6),
        # Each way is rounded up to a nanosecond.
        "memif_ms": pytest.approx(TRANSFERRED[name] / model.memif.bandwidth.bytes_per_ns / 1e6, abs=2e-6),
        "calls_ms": pytest.approx(2 * model.osif.call.ns / 1e6),
    }
    assert row["hardware_ms"] == sum(row["hardware"].values())


@pytest.mark.parametrize("name", TABLE_I)
def test_the_time_in_software_is_that_of_the_profile(table: dict[str, Any], name: str) -> None:
    model = read_profile(PROFILE).model
    assert model is not None
    row = table["callbacks"][name]
    assert row["software_ms"] == pytest.approx(model.callbacks[name].software.ns / 1e6)
    assert row["speedup"] == row["software_ms"] / row["hardware_ms"]
    assert row["basis_hardware"] == model.callbacks[name].compute.basis
    assert row["basis_software"] == model.callbacks[name].software.basis


@pytest.mark.parametrize("name", TABLE_I)
def test_a_published_time_is_that_of_the_paper(table: dict[str, Any], name: str) -> None:
    row = table["callbacks"][name]
    for place in ("hardware", "software"):
        deviation = row[f"{place}_ms"] / row[f"paper_{place}_ms"] - 1
        assert row[f"{place}_deviation"] == deviation
        # Of what is published only the rounding of transfers and of the profile's figures may be left.
        assert row[f"basis_{place}"] == "calibrated" or abs(deviation) < 1e-4


def test_the_speedups_of_table_i_are_those_of_its_times() -> None:
    for row in TABLE_I.values():
        assert row.software_ms / row.hardware_ms == pytest.approx(row.speedup, abs=0.07)


def test_virtual_time_says_nothing_of_the_host(table: dict[str, Any]) -> None:
    assert all(row[key] is None for row in table["callbacks"].values() for key in WALL_ONLY)
    assert table["host"]["overruns"] == 0


def test_another_interface_changes_the_split() -> None:
    model = read_profile(PROFILE).model_dump()["model"]
    slow = changed(
        memif={"bandwidth": model["memif"]["bandwidth"] | {"value": 100}},
        osif={"call": model["osif"]["call"] | {"value": 1, "unit": "ms"}},
    )
    alone = run_alone("virtual", slow, load_project(application_folder()), "sort", Side.HARDWARE, 1)
    assert alone.stages_ms["memif"] == pytest.approx(2 * 8192 / 0.1 / 1e6)
    assert alone.stages_ms["osif"] == pytest.approx(2.0)


def test_nothing_else_runs() -> None:
    """The hash calculation, which would share memory and cores, is not even registered."""
    project = load_project(application_folder())
    for place in Side:
        few = run_alone("virtual", read_profile(PROFILE), project, "sobel", place, 1)
        many = run_alone("virtual", read_profile(PROFILE), project, "sobel", place, 9)
        for stage in ("execution", "memif", "osif"):
            assert few.stages_ms.get(stage) == many.stages_ms.get(stage)


def test_a_wrong_answer_ends_the_experiment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("host_clients.sort.SortExchange.is_right", lambda *_: False)
    with pytest.raises(ExperimentError, match="callback 'sort' in hardware was wrong"):
        run_alone(
            "virtual", read_profile(PROFILE), load_project(application_folder()), "sort", Side.HARDWARE, 1
        )


def test_wall_time_adds_what_the_host_took() -> None:
    alone = run_alone(
        "wall", read_profile(PROFILE), load_project(application_folder()), "sort", Side.HARDWARE, 3
    )
    assert (len(alone.elapsed_ms), len(alone.kernel_ms)) == (3, 3)
    assert min(*alone.elapsed_ms, *alone.kernel_ms) > 0
    model = read_profile(PROFILE).model
    assert model is not None
    # The model's parts stay what they are, however fast the host is.
    assert alone.stages_ms["execution"] == pytest.approx(model.callbacks["sort"].compute.ns / 1e6)


def test_the_native_profile_has_nothing_to_compare() -> None:
    with pytest.raises(UsageError, match="'native' models no board"):
        measure_callbacks("wall", read_profile("native"), 1, lambda: None)


def test_the_command_prints_the_table() -> None:
    done = CliRunner().invoke(app, ["callbacks", "--repeat=1"], env={"COLUMNS": "80"})
    assert done.exit_code == 0, done.output
    assert all(name in done.stdout for name in TABLE_I)
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_the_command_prints_one_object(table: dict[str, Any]) -> None:
    done = CliRunner().invoke(app, ["callbacks", "--repeat=2", "--accuracy", str(SAMPLE), "--json"])
    assert (done.exit_code, done.stderr) == (0, "")
    printed = json.loads(done.stdout)
    assert (printed.pop("digits"), printed.pop("accuracy") > 0.9) == (200, True)
    assert printed == table


@pytest.mark.parametrize("options", [("--json",), ()], ids=["json", "table"])
@pytest.mark.parametrize(("last", "complete"), [("sobel", []), ("sort", ["sobel"])])
def test_callbacks_that_were_complete_before_an_interruption_are_kept(
    monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], last: str, complete: list[str]
) -> None:
    def interrupted(*arguments: Any) -> Any:
        if last in arguments and "software" in arguments:
            raise KeyboardInterrupt
        return run_alone(*arguments)

    monkeypatch.setattr(callbacks, "run_alone", interrupted)
    result = CliRunner().invoke(app, ["callbacks", "--repeat", "1", *options])
    assert result.exit_code == 130
    if options:
        printed = json.loads(result.stdout)
        assert (list(printed["callbacks"]), printed["interrupted"]) == (complete, True)
    else:
        assert ("sobel" in result.stdout) == bool(complete)
        assert "sort" not in result.stdout
        before = "its end" if complete else "anything was measured"
        assert result.stdout.endswith(f"interrupted before {before}\n")
