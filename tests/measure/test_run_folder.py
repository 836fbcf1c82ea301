from __future__ import annotations

import json

import pytest
from board_like_runs import experiment_of

from reconros_zenoh.errors import FileError
from reconros_zenoh.measure.run import load_run


def test_a_run_is_read_back(write_run, board_records):
    spans = {"mixed": {"sort": {"queue": 1.0, "execution": 2}}}
    folder = write_run(board_records, spans=spans, command="reconros demo")
    experiment, records = load_run(folder)
    assert experiment == experiment_of(board_records, spans=spans, command="reconros demo")
    assert {m: list(row) for m, row in records.items()} == {m: list(row) for m, row in board_records.items()}
    ours, theirs = records["mixed"]["sort"], board_records["mixed"]["sort"]
    assert ours.values_ms == pytest.approx(theirs.values_ms, abs=1e-6)


def change(folder, edit):
    path = folder / "experiment.json"
    experiment = json.loads(path.read_text())
    edit(experiment)
    path.write_text(json.dumps(experiment))


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda e: e.pop("mappings"), "mappings"),
        (lambda e: e.update(clock=3), "clock"),
        (lambda e: e["mappings"]["mixed"]["sort"].pop("median_ms"), r"mappings\.mixed\.sort\.median_ms"),
        (lambda e: e["mappings"]["mixed"]["sort"].update(mean_ms="fast"), r"mappings\.mixed\.sort\.mean_ms"),
        (
            lambda e: e["mappings"]["mixed"]["sort"].update(mean_ms=float("nan")),
            r"mappings\.mixed\.sort\.mean_ms",
        ),
        (lambda e: e.update(host={}), r"host\.overruns"),
        (lambda e: e.update(spans={"mixed": {"sort": 3}}), r"spans\.mixed\.sort"),
    ],
)
def test_an_experiment_with_a_fault_is_refused_with_its_place(write_run, board_records, edit, place):
    folder = write_run(board_records)
    change(folder, edit)
    with pytest.raises(FileError, match=rf"experiment\.json: is not an experiment: {place}"):
        load_run(folder)


def test_files_that_are_no_run_are_refused(write_run, board_records, tmp_path):
    with pytest.raises(FileError, match=r"experiment\.json: cannot be read: .*<out>/<clock>"):
        load_run(tmp_path / "nothing")
    folder = write_run(board_records)
    (folder / "mixed" / "sort.csv").unlink()
    with pytest.raises(FileError, match=r"sort\.csv: cannot be read"):
        load_run(folder)
    (folder / "experiment.json").write_text('{\n "clock": \n}')
    with pytest.raises(FileError, match=r"experiment\.json:3: is not JSON"):
        load_run(folder)
    (folder / "experiment.json").write_text("[]")
    with pytest.raises(FileError, match="is not an experiment: the file"):
        load_run(folder)
    (folder / "experiment.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="not UTF-8"):
        load_run(folder)
    for endless in ("[" * 100_000, "9" * 5000):
        (folder / "experiment.json").write_text(endless)
        with pytest.raises(FileError, match="is not an experiment"):
            load_run(folder)
