"""Table II on the board model: exact resources, times on the line, and what the fits are worth."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from reconros_zenoh.board.bitstream_fit import BitstreamFit, frames, left_out_errors
from reconros_zenoh.board.profile import Profile, read_profile
from reconros_zenoh.cli.experiment import app
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments import reconfiguration
from reconros_zenoh.experiments.reconfiguration import TABLE_II, Regression, measure_reconfiguration

PROFILE = "miniitx-zynq7100"
RS0 = "SLICE_X0Y150:SLICE_X103Y199, DSP48_X0Y60:DSP48_X7Y79, RAMB36_X0Y30:RAMB36_X5Y39"
# One column of CLBs (two of slices) and one of DSP slices, one clock region high: 36 + 28 frames.
ONE_COLUMN = "SLICE_X0Y0:SLICE_X1Y49, DSP48_X0Y0:DSP48_X0Y19"
KNOWN = [
    (frames(20800, 160, 60), 2838976),
    (frames(41600, 320, 120), 5285728),
    (frames(40800, 280, 100), 4883328),
]


@pytest.fixture(scope="module")
def table() -> dict[str, Any]:
    return measure_reconfiguration("virtual", read_profile(PROFILE), 100, [RS0, ONE_COLUMN], lambda: None)


def test_resources_and_sizes_are_those_of_table_ii(table: dict[str, Any]) -> None:
    """With the block RAM columns of RS #2 and RS #3 in their right order."""
    keys = ("lut", "dsp", "bram36", "bram18", "size_bytes", "paper_size_bytes", "paper_ms")
    assert {slot: tuple(row[key] for key in keys) for slot, row in table["slots"].items()} == {
        "0": (20800, 160, 60, 120, 2838976, 2838976, 24.0),
        "1": (20800, 160, 60, 120, 2838976, 2838976, 24.0),
        "2": (41600, 320, 120, 240, 5285728, 5285728, 38.4),
        "3": (40800, 280, 100, 200, 4883328, 4883328, 36.9),
    }


def test_every_write_takes_what_the_model_says(table: dict[str, Any]) -> None:
    model = read_profile(PROFILE).model
    assert model is not None
    for row in table["slots"].values():
        expected_ms = row["size_bytes"] / model.icap.bandwidth.bytes_per_ns / 1e6 + model.icap.offset.ns / 1e6
        for key in ("mean_ms", "min_ms", "max_ms"):
            assert row[key] == pytest.approx(expected_ms, abs=1e-6)
        assert row["deviation"] == row["mean_ms"] / row["paper_ms"] - 1


def test_the_regression_finds_the_constants_of_the_profile(table: dict[str, Any]) -> None:
    assert table["regression"]["t_offset_ms"] == pytest.approx(
        table["profile_model"]["t_offset_ms"], abs=1e-5
    )
    assert table["regression"]["bandwidth_mb_s"] == pytest.approx(table["profile_model"]["bandwidth_mb_s"])
    assert table["regression"]["residuals_ms"] == pytest.approx([0] * 4, abs=1e-5)


def test_the_printed_times_give_another_line_than_the_printed_one(table: dict[str, Any]) -> None:
    """The paper says 6.8 ms and about 160 MByte/s; its table gives 6.89 ms and 165.5 MB/s, or 157.9 MiB/s."""
    ours = table["paper"]["regression_of_table"]
    assert ours["t_offset_ms"] == pytest.approx(6.890, abs=5e-4)
    assert ours["bandwidth_mb_s"] == pytest.approx(165.52, abs=5e-3)
    assert ours["bandwidth_mb_s"] * 1e6 / 2**20 == pytest.approx(157.85, abs=5e-3)
    assert sum(ours["residuals_ms"]) == pytest.approx(0, abs=1e-9)
    # What a least-squares line cannot have: all points on one side.
    assert max(table["paper"]["residuals_ms"]) < 0
    assert table["paper"]["residuals_ms"] == pytest.approx([-0.5436, -0.5436, -1.4358, -0.4208])


def test_the_regression_over_slots_of_one_size_is_none() -> None:
    assert Regression.of([1000, 1000], [1.0, 2.0]) is None
    flat = Regression.of([1000, 2000], [2.0, 1.0])
    assert flat is not None
    assert flat.bandwidth_mb_s is None


@given(
    offset_ms=st.floats(0, 100),
    bandwidth_mb_s=st.floats(1, 1000),
    sizes=st.lists(st.integers(10**5, 10**8), min_size=2, max_size=6, unique=True),
)
def test_a_line_is_found_again(offset_ms: float, bandwidth_mb_s: float, sizes: list[int]) -> None:
    if max(sizes) - min(sizes) < 10**5:
        sizes = [*sizes, max(sizes) + 10**6]
    found = Regression.of(sizes, [offset_ms + size / bandwidth_mb_s / 1e3 for size in sizes])
    assert found is not None
    assert found.bandwidth_mb_s == pytest.approx(bandwidth_mb_s, rel=1e-5)
    assert found.t_offset_ms == pytest.approx(offset_ms, abs=1e-2)


def test_what_if(table: dict[str, Any]) -> None:
    row = table["slots"]["2"]["what_if_ms"]
    assert row["zycap_nominal"] == pytest.approx(5285.728 / 382)
    assert row["pcap"] == pytest.approx(5285.728 / 128)
    assert row["zero_copy"] == pytest.approx(5285.728 / 382 + 6.8)
    assert all("published" in text or "profile" in text for text in table["what_if"].values())
    assert all("assumed" in text for text in table["what_if"].values())


def test_a_region_of_the_profile_keeps_its_size(table: dict[str, Any]) -> None:
    known, estimated = table["regions"]
    assert (known["known"], known["size_bytes"], known["region"]) == (True, 2838976, RS0)
    assert known["t_rc_ms"] == pytest.approx(table["slots"]["0"]["mean_ms"], abs=1e-6)
    assert (estimated["known"], estimated["lut"], estimated["dsp"], estimated["bram36"]) == (
        False,
        400,
        20,
        0,
    )


def test_another_region_takes_its_frames(table: dict[str, Any]) -> None:
    fit = table["bitstream_fit"]
    estimated = table["regions"][1]["size_bytes"]
    assert estimated == round(fit["constant_bytes"] + 64 * fit["bytes_per_frame"])
    assert read_profile(PROFILE).bitstream_size(400, 20, 0) == estimated


def test_how_well_the_size_is_fitted(table: dict[str, Any]) -> None:
    fit = table["bitstream_fit"]
    slope, constant = np.polyfit(*np.array(KNOWN, dtype=float).T, 1)
    assert (fit["bytes_per_frame"], fit["constant_bytes"]) == pytest.approx((slope, constant))
    assert fit["points"] == 3
    assert fit["largest_error"] == pytest.approx(0.00553, abs=1e-5)
    assert fit["left_out_errors"] == pytest.approx([-0.0707, -0.0105, 0.0097], abs=1e-4)


def test_frames_of_a_clock_region() -> None:
    """Project X-Ray: 36 frames for a column of CLBs, 28 for one of DSP slices, 28 + 128 for block RAM."""
    assert (frames(400, 0, 0), frames(0, 20, 0), frames(0, 0, 10)) == pytest.approx((36, 28, 156))


@pytest.mark.parametrize(
    "known",
    [
        [(100.0, 1000)],
        [(100.0, 900), (100.0, 1100)],
        [(100.0, 500), (200.0, 1500)],
        [(100.0, 900), (200.0, 800)],
    ],
    ids=["one slot", "slots alike", "a constant below nothing", "larger is less"],
)
def test_without_a_line_the_size_is_proportional(known: list[tuple[float, int]]) -> None:
    fit = BitstreamFit.of(known)
    assert fit.constant == 0
    assert fit.bytes_per_frame == pytest.approx(sum(x * y for x, y in known) / sum(x * x for x, _ in known))


@given(st.lists(st.tuples(st.floats(1, 1e5), st.integers(1, 10**8)), min_size=2, max_size=6))
def test_no_size_is_below_nothing(known: list[tuple[float, int]]) -> None:
    fit = BitstreamFit.of(known)
    assert fit.constant >= 0
    assert fit.bytes_per_frame >= 0
    assert len(left_out_errors(known)) == len(known)
    assert min(left_out_errors(known)) >= -1


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("SLICE_X0Y0:DSP48_X9Y9", "--region holds 'SLICE_X0Y0:DSP48_X9Y9', which is no rectangle"),
        ("SLICE_X9Y0:SLICE_X0Y9", "The corners of .* are swapped"),
        ("SLICE_X0Y0:SLICE_X9Y9, SLICE_X5Y5:SLICE_X6Y6", "overlaps"),
        ("", "holds no SLICE, DSP48 or RAMB36"),
        ("URAM288_X0Y0:URAM288_X1Y1", "holds no SLICE, DSP48 or RAMB36"),
    ],
)
def test_what_is_no_region(text: str, problem: str) -> None:
    with pytest.raises(UsageError, match=problem):
        measure_reconfiguration("virtual", read_profile(PROFILE), 1, [text], lambda: None)


def test_the_native_profile_has_no_configuration_port() -> None:
    with pytest.raises(UsageError, match="'native' models no configuration port"):
        measure_reconfiguration("virtual", read_profile("native"), 1, [], lambda: None)


def test_slots_of_one_size_have_no_regression() -> None:
    content = read_profile(PROFILE).model_dump()
    for slot in content["model"]["bitstreams"]:
        slot["size"]["value"] = 1_000_000
    table = measure_reconfiguration("virtual", Profile.model_validate(content), 2, [], lambda: None)
    assert table["regression"] is None


def test_wall_time_measures_every_slot() -> None:
    """Only what must hold on any host."""
    table = measure_reconfiguration("wall", read_profile(PROFILE), 2, [], lambda: None)
    for row in table["slots"].values():
        assert 0 <= row["min_ms"] <= row["mean_ms"] <= row["max_ms"]


def test_the_command_prints_the_tables() -> None:
    done = CliRunner().invoke(app, ["reconfiguration", "--region", ONE_COLUMN], env={"COLUMNS": "80"})
    assert done.exit_code == 0, done.output
    assert all(f"RS{slot}" in done.stdout for slot in TABLE_II)
    assert "t_offset [ms]" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_the_command_prints_one_object(table: dict[str, Any]) -> None:
    done = CliRunner().invoke(app, ["reconfiguration", "--region", RS0, "--region", ONE_COLUMN, "--json"])
    assert (done.exit_code, done.stderr) == (0, "")
    assert json.loads(done.stdout) == json.loads(json.dumps(table))


@pytest.mark.parametrize("complete", [0, 1, 3])
def test_slots_that_were_complete_before_an_interruption_are_kept(
    monkeypatch: pytest.MonkeyPatch, complete: int
) -> None:
    row = reconfiguration._row

    def interrupted(slot: Any, *arguments: Any) -> Any:
        if slot.slot_id == complete:
            raise KeyboardInterrupt
        return row(slot, *arguments)

    monkeypatch.setattr(reconfiguration, "_row", interrupted)
    command = ["reconfiguration", "--writes", "1"]
    shown, told = CliRunner().invoke(app, command), CliRunner().invoke(app, [*command, "--json"])
    assert (shown.exit_code, told.exit_code) == (130, 130), shown.output
    printed = json.loads(told.stdout)
    assert (len(printed["slots"]), printed["interrupted"]) == (complete, True)
    assert (printed["regression"] is None) == (complete < 3)  # RS0 and RS1 are alike
    assert "printed t_rc, our regression" in shown.stdout
    before = "its end" if complete else "anything was measured"
    assert shown.stdout.endswith(f"interrupted before {before}\n")
