"""`reconros experiment roundtrip` from the outside: what it prints, records and leaves behind."""

from __future__ import annotations

import json
import os
from concurrent.futures import ThreadPoolExecutor
from signal import SIGINT, SIGTERM, Signals
from typing import TYPE_CHECKING, Any, NamedTuple

import psutil
import pytest
from processes import LIMIT_S, Process, run

from reconros_zenoh.experiments.roundtrip import CLIENTS, application_folder

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from subprocess import CompletedProcess

KEYS = {
    "experiment",
    "clock",
    "requests",
    "seed",
    "mappings",
    "speedup_of_means",
    "speedup_of_medians",
    "host",
}
CELL_KEYS = {
    *(
        "n",
        "lost",
        "wrong",
        "mean_ms",
        "p5_ms",
        "p25_ms",
        "median_ms",
        "p75_ms",
        "p95_ms",
        "p99_ms",
        "max_ms",
    ),
    *("reference_median_ms", "median_error"),
}
HOST_KEYS = {"overruns", "lag_p50_us", "lag_p99_us", "real_time_priority"}
ROUND_TRIP = ("experiment", "roundtrip")
ENDLESS = "--requests=1000000"
both_signals = pytest.mark.parametrize("number", [SIGINT, SIGTERM], ids=lambda number: number.name)


def assert_contract(done: CompletedProcess[str], **expected: object) -> dict[str, Any]:
    """Fail unless the command printed the object of the contract, and nothing else; return it.

    The exit status must say whether all requests were answered rightly.
    """
    assert done.stderr == ""
    experiment: dict[str, Any] = json.loads(done.stdout)
    assert experiment.keys() >= KEYS
    assert experiment["host"].keys() >= HOST_KEYS
    assert {name: experiment[name] for name in expected} == expected
    assert experiment["experiment"] == "roundtrip"
    lost = 0
    for cells in experiment["mappings"].values():
        assert cells.keys() == set(CLIENTS)
        for cell in cells.values():
            assert cell.keys() >= CELL_KEYS
            assert (cell["n"] + cell["lost"], cell["wrong"]) == (expected["requests"], 0)
            lost += cell["lost"]
            percentiles = [cell[f"{name}_ms"] for name in ("p5", "p25", "median", "p75", "p95", "p99", "max")]
            assert percentiles[0] > 0
            assert percentiles == sorted(percentiles)
            assert percentiles[0] <= cell["mean_ms"] <= percentiles[-1]
    assert done.returncode == (1 if lost else 0)
    return experiment


def test_wall_time_gives_the_object_of_the_contract(tmp_path: Path) -> None:
    # Where no link is modelled none loses anything.
    done = run(
        *(*ROUND_TRIP, "--clock=wall", "--requests=3", "--mapping=all_hardware", "--profile=native"),
        *("--json", "--out", tmp_path),
    )
    assert done.returncode == 0, done.stderr
    experiment = assert_contract(done, clock="wall", requests=3, seed=0, interrupted=False)
    assert experiment["mappings"].keys() == {"all_hardware"}
    assert experiment["host"]["lag_p50_us"] >= 0
    assert json.loads((tmp_path / "wall" / "experiment.json").read_text(encoding="utf-8")) == experiment
    for client in CLIENTS:
        record = (tmp_path / "wall" / "all_hardware" / f"{client}.csv").read_text(encoding="ascii")
        assert [line.split(",")[0::2] for line in record.splitlines()] == [
            ["index", "outcome"],
            *([str(index), "ok"] for index in range(3)),
        ]


class VirtualRun(NamedTuple):
    """What a run in virtual time printed, and the folder of its records."""

    done: CompletedProcess[str]
    folder: Path


@pytest.fixture(scope="module")
def virtual(tmp_path_factory: pytest.TempPathFactory) -> dict[str, VirtualRun]:
    """Return three runs, the first two with the same seed, as on a computer that never drew anything."""
    folder = tmp_path_factory.mktemp("virtual")
    mapping = folder / "mine.toml"
    mapping.write_bytes((application_folder() / "mappings" / "mixed.toml").read_bytes())

    def run_with(name: str, seed: int) -> VirtualRun:
        options = ("--clock=virtual", "--requests=20", "--mapping", mapping, "--json")
        done = run(*ROUND_TRIP, *options, "--seed", seed, "--out", folder / name)
        return VirtualRun(done, folder / name / "virtual" / "mine")

    names = ("first", "again", "other")
    with pytest.MonkeyPatch.context() as environment, ThreadPoolExecutor() as pool:
        environment.setenv("MPLCONFIGDIR", str(folder / "matplotlib"))
        return dict(zip(names, pool.map(run_with, names, (7, 7, 8)), strict=True))


def _records(folder: Path) -> dict[str, bytes]:
    records = {path.stem: path.read_bytes() for path in folder.glob("*.csv")}
    assert records.keys() == set(CLIENTS)
    return records


def test_virtual_time_gives_the_same_object_under_the_name_of_the_mapping_file(
    virtual: dict[str, VirtualRun],
) -> None:
    experiment = assert_contract(
        virtual["first"].done, clock="virtual", requests=20, seed=7, interrupted=False
    )
    assert experiment["mappings"].keys() == {"mine"}
    assert experiment["host"]["lag_p50_us"] is None


def test_the_drawing_lies_beside_the_records_and_repeats_itself(virtual: dict[str, VirtualRun]) -> None:
    first, again, other = (
        (virtual[name].folder.parent / "roundtrips.png").read_bytes() for name in ("first", "again", "other")
    )
    assert first.startswith(b"\x89PNG")
    assert first == again != other


def test_virtual_time_repeats_itself_to_the_byte(
    virtual: dict[str, VirtualRun],
) -> None:
    assert _records(virtual["first"].folder) == _records(virtual["again"].folder)
    first, again = (json.loads(virtual[name].done.stdout) for name in ("first", "again"))
    assert first["mappings"] == again["mappings"]
    assert first["spans"] == again["spans"]


def test_another_seed_gives_other_times(virtual: dict[str, VirtualRun]) -> None:
    first, other = _records(virtual["first"].folder), _records(virtual["other"].folder)
    # The inputs differ, and with them what the network retransmits.
    assert first["sobel"] != other["sobel"]


@pytest.fixture
def in_the_middle(tmp_path: Path) -> Iterator[tuple[Process, list[psutil.Process]]]:
    """Return an endless experiment in wall time that has recorded round trips, and its children."""
    arguments = ("--clock=wall", "--mapping=all_hardware", ENDLESS, "--out", tmp_path)
    with Process(*ROUND_TRIP, *arguments) as experiment:
        experiment.wait_for("wall time, all_hardware: 5000000 round trips ...")
        children = psutil.Process(experiment.pid).children(recursive=True)
        yield experiment, children
        # They may take a moment to be noticed as gone.
        assert not psutil.wait_procs(children, timeout=LIMIT_S)[1]


def _commands(children: list[psutil.Process]) -> list[str]:
    """Return the verbs of the children, clients by their names."""
    lines = [child.cmdline() for child in children]
    words = [line[line.index("reconros_zenoh") + 1 :] for line in lines]
    return sorted(arguments[1] if arguments[0] == "client" else arguments[0] for arguments in words)


def _interrupted(folder: Path, clock: str) -> dict[str, Any]:
    experiment: dict[str, Any] = json.loads((folder / clock / "experiment.json").read_text(encoding="utf-8"))
    assert experiment["interrupted"] is True
    assert experiment["host"]["overruns"] is not None
    assert experiment["spans"]["all_hardware"]
    assert experiment["timing"].keys() == {"all_hardware"}
    cells: dict[str, Any] = experiment["mappings"]["all_hardware"]
    return cells


@both_signals
def test_an_interrupted_experiment_stops_its_processes_and_keeps_its_records(
    in_the_middle: tuple[Process, list[psutil.Process]], tmp_path: Path, number: Signals
) -> None:
    experiment, children = in_the_middle
    assert _commands(children) == sorted([*CLIENTS, "board", "router"])
    assert experiment.end(number) == 130, experiment
    cells = _interrupted(tmp_path, "wall")
    for client, cell in cells.items():
        record = (tmp_path / "wall" / "all_hardware" / f"{client}.csv").read_text(encoding="ascii")
        assert (cell["n"] + cell["lost"], cell["wrong"]) == (record.count("\n") - 1, 0)
    assert sum(cell["n"] for cell in cells.values()) > 0
    assert experiment.out[-1] == "interrupted before its end"
    assert "Traceback" not in repr(experiment)


def test_a_board_that_dies_ends_the_experiment(
    in_the_middle: tuple[Process, list[psutil.Process]], tmp_path: Path
) -> None:
    experiment, children = in_the_middle
    (board,) = (child for child in children if "board" in child.cmdline())
    board.kill()
    assert experiment.end() == 1
    first = experiment.err.index("reconros: Service board was ended by SIGKILL.")
    log = tmp_path / "wall" / "all_hardware" / "logs" / "board.log"
    title, *quoted = experiment.err[first + 1 :]
    assert title == f"The end of its log ({log}):"
    assert quoted == [f"    {line}" for line in log.read_text(encoding="utf-8").splitlines()]
    assert "board board0 serves roundtrip" in quoted[0]


@both_signals
def test_an_interrupted_experiment_in_virtual_time_keeps_its_records(tmp_path: Path, number: Signals) -> None:
    arguments = ("--clock=virtual", "--mapping=all_hardware", ENDLESS, "--out", tmp_path)
    with Process(*ROUND_TRIP, *arguments) as experiment:
        experiment.wait_for("virtual time, all_hardware: 5000000 round trips ...")
        os.kill(experiment.pid, number)
        assert experiment.end(number) == 130  # some press Ctrl-C more than once
        cells = _interrupted(tmp_path, "virtual")
        assert sum(cell["n"] for cell in cells.values()) > 0
        assert experiment.out[-1] == "interrupted before its end"
        assert "Traceback" not in repr(experiment)
