"""`reconros calibrate`: it finds what made the measurements, and says what they do not tell."""

from __future__ import annotations

import json
import math
import re
import tomllib
from importlib import resources
from typing import TYPE_CHECKING, Self

import numpy as np
import pytest
import typer

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.calibrate import calibrate as command
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.experiments import calibration
from reconros_zenoh.experiments.calibration import (
    _FRACTIONS,
    _JUDGES,
    _SEEDS,
    SAMPLES,
    Constant,
    _Evaluation,
    _Search,
    calibrated_constants,
)
from reconros_zenoh.experiments.measured import read_measurements
from reconros_zenoh.experiments.parallel import Run, records_of
from reconros_zenoh.experiments.profile_file import new_profile, varied, with_values
from reconros_zenoh.experiments.roundtrip import CLIENTS, application_folder
from reconros_zenoh.measure.record import Record
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.toml_file import TomlFile

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    import numpy.typing as npt

MINIITX = (resources.files("reconros_zenoh.board") / "profiles" / "miniitx-zynq7100.toml").read_text("utf-8")
MIXED = application_folder() / "mappings" / "mixed.toml"
PROJECT = load_project(application_folder())

PER_MESSAGE = ("model", "dds", "per_message")
MNIST_IN_SOFTWARE = ("model", "callbacks", "mnist", "software")  # which the mapping mixed never runs


def fitting_only(path: Path, *places: tuple[str, ...]) -> Path:
    """Write the shipped profile without chance, with these constants calibrated and all others assumed."""
    text = MINIITX.replace('"calibrated"', '"assumed"')
    # With nothing left to chance, and no poll grid, a few requests are enough.
    polls = ("hardware_poll", "software_poll", "poll_jitter")
    for name in (*polls, "jitter", "nack_probability", "loss_probability", "loss_probability_busy"):
        text = re.sub(rf"^{name} = {{ value = [0-9.]+", f"{name} = {{ value = 0", text, flags=re.MULTILINE)
    path.write_text(text)
    lines = path.read_text().splitlines(keepends=True)
    for place in places:
        number = TomlFile.read(path).line(place)
        assert number is not None
        lines[number - 1] = lines[number - 1].replace('"assumed"', '"calibrated"')
    path.write_text("".join(lines))
    assert [constant.place for constant in calibrated_constants(read_profile(str(path)))] == list(places)
    return path


def measure(folder: Path, mapping: str, text: str = "", client: str = "sort") -> Path:
    """Write a file of times and return the folder of the mappings."""
    path = folder / mapping / f"{client}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text or "Sort;\n" + "2.5;\n" * 30)
    return folder


def test_a_constant_is_recovered_from_what_a_board_with_another_value_did(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    profile = fitting_only(tmp_path / "p.toml", PER_MESSAGE, MNIST_IN_SOFTWARE)
    shipped = read_profile(str(profile))
    assert shipped.model is not None
    start = shipped.model.dds.per_message.value
    truth = 1.8 * start
    data = tmp_path / "data"
    records = records_of(Run(varied(shipped, {PER_MESSAGE: truth}), MIXED, 40, 90))
    for client in ("inverse", "sort"):
        times = "".join(f"{value};\n" for value in records[client].values_ms)
        measure(data, "another_name", f"Times;\n999;\n{times}12345;\n", client)
    out = tmp_path / "new" / "p2.toml"

    command(
        str(profile),
        [data],
        out,
        mapping=["another_name=mixed"],
        trim=True,
        rounds=2,
        requests=20,
        seed=1,
        as_json=True,
    )

    printed, errors = capsys.readouterr()
    assert errors == ""
    found = json.loads(printed)
    by_name = {constant["name"]: constant for constant in found["constants"]}
    fitted, unused = by_name["dds.per_message"], by_name["callbacks.mnist.software"]
    assert fitted["old"] == start
    assert fitted["new"] == pytest.approx(truth, rel=0.2)
    assert fitted["determined"]
    assert (unused["new"], unused["sensitivity"], unused["determined"]) == (unused["old"], 0, False)
    assert found["objective"]["after"] < found["objective"]["before"] / 2
    assert {(cell["mapping"], cell["client"]) for cell in found["cells"]} == {
        ("another_name", "inverse"),
        ("another_name", "sort"),
    }
    # The new file is the old one but for this value.
    assert [path.name for path in out.parent.iterdir()] == ["p2.toml"]
    old_lines, new_lines = profile.read_text().splitlines(), out.read_text().splitlines()
    changed = [pair for pair in zip(old_lines, new_lines, strict=True) if pair[0] != pair[1]]
    assert [new.split(" = ")[0] for _, new in changed] == ["per_message"]
    assert tomllib.loads(out.read_text())["model"]["dds"]["per_message"]["value"] == fitted["new"]


def test_only_calibrated_constants_above_nothing_are_fitted(tmp_path: Path) -> None:
    constants = {
        constant.name: constant for constant in calibrated_constants(read_profile("miniitx-zynq7100"))
    }
    assert "dds.nack_probability" in constants
    assert constants["dds.nack_probability"].most < 1
    assert constants["dds.core_share"].most == 1
    assert "icap.bandwidth" not in constants  # published
    assert "memif.bandwidth" not in constants  # assumed
    path = fitting_only(tmp_path / "p.toml", PER_MESSAGE)
    profile = read_profile(str(path))
    with pytest.raises(UsageError, match="no constant to fit"):
        calibrated_constants(varied(profile, {PER_MESSAGE: 0.0}))
    with pytest.raises(UsageError, match="no constant to fit"):
        calibrated_constants(read_profile("native"))


@pytest.mark.parametrize(
    "written",
    [
        '[model.dds.per_message]\n# how long\nvalue = 3e-1 # ms\nunit = "ms"\nbasis = "calibrated"\n',
        '[model.dds]\nper_message = { unit = "ms", basis = "calibrated", value = 0.3 }\n',
    ],
)
def test_values_are_replaced_and_all_else_is_kept(tmp_path: Path, written: str) -> None:
    path = tmp_path / "p.toml"
    lines = [line for line in MINIITX.splitlines(keepends=True) if not line.startswith("per_message")]
    text = "".join(lines)
    header, rest = written.split("\n", 1)
    if header == "[model.dds]":
        text = text.replace("[model.dds]\n", written)
    else:
        text += "\n" + written
    path.write_text(text)
    profile = varied(read_profile(str(path)), {PER_MESSAGE: 0.4321})
    new = with_values(TomlFile.read(path), {PER_MESSAGE: 0.4321}, profile)
    path.write_text(new)
    assert read_profile(str(path)) == profile
    assert "value = 0.4321" in new
    differing = [pair for pair in zip(text.splitlines(), new.splitlines(), strict=True) if pair[0] != pair[1]]
    assert len(differing) == 1
    assert rest


def test_a_value_that_cannot_be_replaced_is_named_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(
        MINIITX.replace("per_message = { value =", 'per_message = { source = "once value = 1", value =')
    )
    profile = varied(read_profile(str(path)), {PER_MESSAGE: 0.4321})
    with pytest.raises(FileError, match=r"p\.toml:\d+: the value of model\.dds\.per_message cannot"):
        with_values(TomlFile.read(path), {PER_MESSAGE: 0.4321}, profile)


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("Sort;\n" + "2.5;\n" * 30 + "fast;\n", 32, "'fast' is not a time"),
        ("Sort;\n" + "2.5;\n" * 30 + "-1;\n", 32, "'-1' is not a time"),
        ("Sort;\n2.5;;2.6;\n" + "2.5;\n" * 30, 2, "a value is missing"),
        ("Sort;\n" + "2.5;\n" * 19, None, "holds 19 times, too few"),
        ("Sort;\n", None, "holds no times"),
        ("Sort;\n" + "0;\n" * 30, None, "a quarter of its times are 0 ms"),
    ],
)
def test_bad_measurements_are_named_with_their_line(
    tmp_path: Path, text: str, line: int | None, problem: str
) -> None:
    folder = measure(tmp_path / "data", "mixed", text)
    with pytest.raises(FileError) as caught:
        read_measurements([folder], PROJECT, {}, trim=False)
    assert (caught.value.path, caught.value.line) == (folder / "mixed" / "sort.csv", line)
    assert problem in caught.value.problem
    assert caught.value.remedy


def test_the_trimmed_values_do_not_count(tmp_path: Path) -> None:
    folder = measure(tmp_path / "data", "mixed", "Sort;\n" + "2.5;\n" * 21)
    assert len(read_measurements([folder], PROJECT, {}, trim=False)) == 1
    with pytest.raises(FileError, match="holds 19 times"):
        read_measurements([folder], PROJECT, {}, trim=True)


def test_quartiles_are_taken_modulo_a_second(tmp_path: Path) -> None:
    folder = measure(tmp_path / "data", "mixed", "\n".join(str(1000 * i + i) for i in range(1, 42)))
    (found,) = read_measurements([folder], PROJECT, {}, trim=False)
    assert found.quartiles_ms["sort"].tolist() == [11, 21, 31]


def test_the_mapping_of_a_folder_is_found(tmp_path: Path) -> None:
    given = tmp_path / "elsewhere.toml"
    given.write_bytes(MIXED.read_bytes())
    folder = measure(tmp_path / "data", "mixed")
    for name in ("beside", "inside", "given"):
        measure(folder, name)
    (folder / "beside.toml").write_bytes(MIXED.read_bytes())
    (folder / "inside" / "inside.toml").write_bytes(MIXED.read_bytes())
    found = read_measurements([folder], PROJECT, {"given": str(given)}, trim=False)
    assert {mapping.name: mapping.mapping for mapping in found} == {
        "mixed": MIXED,
        "beside": folder / "beside.toml",
        "inside": folder / "inside" / "inside.toml",
        "given": given,
    }


def test_what_has_no_mapping_or_client_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"somewhere: no mapping named 'somewhere'.*--mapping somewhere=FILE"):
        read_measurements([measure(tmp_path / "a", "somewhere")], PROJECT, {}, trim=False)
    with pytest.raises(FileError, match=r"filter\.csv: no client is named 'filter'"):
        read_measurements([measure(tmp_path / "b", "mixed", client="filter")], PROJECT, {}, trim=False)
    good = measure(tmp_path / "c", "mixed")
    with pytest.raises(UsageError, match="no folder mxied was measured"):
        read_measurements([good], PROJECT, {"mxied": "mixed"}, trim=False)
    with pytest.raises(FileError, match="second folder for this mapping"):
        read_measurements([good, good], PROJECT, {}, trim=False)
    with pytest.raises(FileError, match="holds no measurements"):
        read_measurements([good / "mixed"], PROJECT, {}, trim=False)
    with pytest.raises(FileError, match="is no folder"):
        read_measurements([tmp_path / "nowhere"], PROJECT, {}, trim=False)
    (good / "mixed.toml").write_text("executor = 3")
    with pytest.raises(FileError, match=r"mixed\.toml:1: executor"):
        read_measurements([good], PROJECT, {}, trim=False)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'recovery = { value = 3.4, unit = "ms"',
            'recovery = { value = -1, unit = "ms"',
            r"p\.toml:\d+: .*recovery",
        ),
        ('recovery = { value = 3.4, unit = "ms"', 'recovery = { value = 3.4, unit = "h"', "unknown unit 'h'"),
        ("stalled_by_reconfiguration = true\n", "", r"p\.toml:\d+: .*stalled_by_reconfiguration"),
    ],
)
def test_a_bad_profile_is_refused_before_anything_runs(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "p.toml"
    assert old in MINIITX
    path.write_text(MINIITX.replace(old, new))
    with pytest.raises(FileError, match=message):
        command(str(path), [measure(tmp_path / "data", "mixed")], tmp_path / "p2.toml")
    assert not (tmp_path / "p2.toml").exists()


def test_an_unwritable_out_is_refused_at_once_and_an_old_one_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("old")
    for out in (tmp_path, file / "below.toml"):
        with pytest.raises(UsageError, match=r"is a folder|cannot be written"), new_profile(out):
            pytest.fail("it must not begin")

    def stop(partial: Path) -> None:
        partial.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), new_profile(file) as partial:
        stop(partial)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert file.read_text() == "old"


def test_an_assignment_needs_both_sides(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="write NAME=MAPPING"):
        command(
            "miniitx-zynq7100",
            [measure(tmp_path / "data", "mixed")],
            tmp_path / "p2.toml",
            mapping=["mixed"],
        )


CONSTANTS = [Constant(("model", name), "ns", 1.0, 100.0) for name in ("a", "b", "c")]


def searched(
    rounds: int, residuals: Callable[[npt.NDArray[np.float64]], Sequence[float]], noise: float = 0.0
) -> tuple[_Search, list[int]]:
    """Return the search from 1 for all constants, and the samples that it asked for."""
    samples: list[int] = []

    def evaluate(asked: Sequence[tuple[Sequence[float], int]]) -> list[_Evaluation]:
        found = []
        for values, sample in asked:
            samples.append(sample)
            exact = np.array(residuals(np.log(values)))
            chance = np.random.default_rng(sample).normal(0, noise, exact.size)
            found.append(_Evaluation({}, exact + chance))
        return found

    search = _Search(CONSTANTS, [1.0, 1.0, 1.0], evaluate([([1.0, 1.0, 1.0], 0)]))
    search.run(rounds, evaluate)
    return search, samples[1:]


def test_constants_that_only_together_make_a_difference_are_found_and_others_stay() -> None:
    def residuals(logs: npt.NDArray[np.float64]) -> list[float]:
        a, b, _ = logs
        return [2 * (a + b - 0.9), a - b - 0.1, 0.3 * (a - 0.5), 7.0]  # the last is nobody's

    search, samples = searched(6, residuals, noise=0.01)
    assert np.log(search.values[:2]) == pytest.approx([0.5, 0.4], abs=0.05)
    assert search.values[2] == pytest.approx(1, abs=0.02)
    assert len(samples) == 6 * (2 * 3 + _JUDGES * (1 + len(_FRACTIONS)))
    # What was promised with some seeds is judged with others, each time.
    assert len(set(samples)) == 6 * (1 + _JUDGES)


def test_the_search_stays_where_nothing_is_better_and_ends_when_its_steps_are_small() -> None:
    search, samples = searched(100, lambda logs: [*(5 + np.abs(logs)), 0.0])
    assert search.values == [1.0, 1.0, 1.0]
    assert len(samples) == 4 * (2 * 3 + _JUDGES * (1 + len(_FRACTIONS)))  # steps of 0.2, 0.1, 0.05, 0.025


def test_a_constant_is_not_moved_beyond_its_most() -> None:
    search, _ = searched(20, lambda logs: [logs[0] - math.log(500), logs[1], logs[2]])
    assert search.values[0] == 100.0


class _Runs:
    """Runs whose sort takes as many ms as per_message says, interrupted after so many."""

    left = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def records(self, runs: Iterable[Run]) -> Iterator[dict[str, Record]]:
        for run in runs:
            if not _Runs.left:
                raise KeyboardInterrupt
            _Runs.left -= 1
            assert run.profile.model is not None
            value = run.profile.model.dds.per_message.value
            yield {client: Record(client, np.full(3, value)) for client in ("sort", *CLIENTS)}


@pytest.mark.parametrize("as_json", [False, True])
def test_an_interrupted_search_keeps_the_best_that_it_has_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], as_json: bool
) -> None:
    profile = fitting_only(tmp_path / "p.toml", PER_MESSAGE)
    start = read_profile(str(profile)).model.dds.per_message.value  # type: ignore[union-attr]
    data = measure(tmp_path / "data", "mixed", "Sort;\n" + f"{3 * start};\n" * 30)
    monkeypatch.setattr(calibration, "ParallelRuns", _Runs)
    round_of_one = 2 + _JUDGES * (1 + len(_FRACTIONS))
    _Runs.left = (SAMPLES + round_of_one) * _SEEDS + 1  # in the search's second round
    out = tmp_path / "p2.toml"
    with pytest.raises(typer.Exit) as ended:
        command(str(profile), [data], out, as_json=as_json)
    assert ended.value.exit_code == 130
    printed = capsys.readouterr().out
    better = pytest.approx(2 * start, rel=0.001)
    assert tomllib.loads(out.read_text())["model"]["dds"]["per_message"]["value"] == better
    if as_json:
        found = json.loads(printed)
        assert found["interrupted"]
        (constant,) = found["constants"]
        assert (constant["new"], constant["sensitivity"], constant["determined"]) == (better, None, None)
        (cell,) = found["cells"]
        assert cell["after"]["median_ms"] == better
    else:
        assert printed.endswith("interrupted before its end\n")
        assert "do not determine" not in printed


class _MisleadingRuns(_Runs):
    """Runs whose times are a third of that for the seeds of the search."""

    def records(self, runs: Iterable[Run]) -> Iterator[dict[str, Record]]:
        runs = list(runs)
        _Runs.left = len(runs)
        for run, records in zip(runs, super().records(runs), strict=True):
            share = 1 if run.seed < SAMPLES * _SEEDS else 1 / 3
            yield {client: Record(client, share * record.values_ms) for client, record in records.items()}


def test_what_is_worse_than_before_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    profile = fitting_only(tmp_path / "p.toml", PER_MESSAGE)
    start = read_profile(str(profile)).model.dds.per_message.value  # type: ignore[union-attr]
    data = measure(tmp_path / "data", "mixed", "Sort;\n" + f"{1.1 * start};\n" * 30)
    monkeypatch.setattr(calibration, "ParallelRuns", _MisleadingRuns)
    out = tmp_path / "p2.toml"
    command(str(profile), [data], out, rounds=2)
    assert tomllib.loads(out.read_text()) == tomllib.loads(profile.read_text())
    printed = " ".join(capsys.readouterr().out.split())
    assert "objective 0.286 before, 0.286 after" in printed  # three quartiles, each off by a tenth
    assert "nothing better was found: the constants are as they were. More --requests" in printed


def test_what_is_interrupted_before_the_search_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(calibration, "ParallelRuns", _Runs)
    _Runs.left = 2
    with pytest.raises(typer.Exit) as ended:
        command("miniitx-zynq7100", [measure(tmp_path / "data", "mixed")], tmp_path / "p2.toml")
    assert ended.value.exit_code == 130
    assert capsys.readouterr().out == "interrupted before anything was measured\n"
    assert [path.name for path in tmp_path.iterdir()] == ["data"]
