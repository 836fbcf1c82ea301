from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from reconros_zenoh.cli.hist import hist
from reconros_zenoh.errors import FileError, UsageError

application = typer.Typer()
application.command("hist")(hist)


def run(*arguments):
    """What the command prints; raises what it raises."""
    result = CliRunner().invoke(application, [str(argument) for argument in arguments], env={"COLUMNS": "80"})
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture
def folder(write_run, board_records):
    return write_run(board_records)


def test_a_folder_shows_every_record(folder):
    output = run(folder)
    assert [line for line in output.splitlines() if "/" in line and ":" not in line] == sorted(
        f"{m}/{c}"
        for m in ("all_software", "mixed", "all_hardware")
        for c in ("sort", "inverse", "sobel", "mnist", "hash")
    )
    assert "█" in output


def test_json_has_stable_names(folder):
    data = json.loads(run(folder / "mixed" / "sort.csv", "--json", "--bins", 5))
    (record,) = data["records"]
    assert record["name"] == "mixed/sort"
    assert record["path"] == str(folder / "mixed" / "sort.csv")
    assert record["n"] == 201
    assert len(record["counts"]) == 5
    assert record["compare"] is None


def test_a_file_given_twice_is_shown_once(folder):
    data = json.loads(run(folder, folder / "mixed" / "sort.csv", "--json"))
    assert len(data["records"]) == 15


def test_two_files_are_compared(folder):
    data = json.loads(
        run(folder / "mixed" / "sort.csv", "--compare", folder / "all_software" / "sort.csv", "--json")
    )
    (record,) = data["records"]
    assert record["compare"]["name"] == "all_software/sort"
    assert record["compare"]["median_ratio"] == pytest.approx(2.633 / 51.739, rel=1e-3)


def test_folders_are_compared_by_mapping_and_client(folder, write_run, board_records):
    other = write_run({"mixed": board_records["mixed"], "mine": board_records["mixed"]}, "wall")
    data = json.loads(run(folder, "--compare", other, "--json"))
    compared = {record["name"]: record["compare"] for record in data["records"]}
    assert compared["mixed/sort"]["path"] == str(other / "mixed" / "sort.csv")
    assert compared["all_software/sort"] is None
    output = run(folder, "--compare", other)
    assert "virtual/mixed/sort | wall/mixed/sort" in output
    assert "median ratio 1.000" in output
    assert "all_software/sort" in output.replace("\n", " ").split(f"not in {other}")[-1]


def test_two_mappings_are_compared_by_client(folder):
    data = json.loads(run(folder / "mixed", "--compare", folder / "all_software", "--json"))
    compared = {record["name"]: record["compare"]["name"] for record in data["records"]}
    assert len(compared) == 5
    assert compared["mixed/sobel"] == "all_software/sobel"


def test_a_mapping_is_not_compared_with_one_of_several(folder, write_run, board_records):
    other = write_run({"mine": board_records["mixed"], "yours": board_records["mixed"]}, "wall")
    with pytest.raises(UsageError, match="none of its records"):
        run(folder / "mixed", "--compare", other)


def test_the_histograms_are_drawn(folder, tmp_path):
    run(folder / "mixed", "--png", tmp_path / "h.png")
    assert (tmp_path / "h.png").read_bytes().startswith(b"\x89PNG")


def test_a_name_that_is_not_utf_8_is_drawn(folder, tmp_path):
    record = folder / "mixed" / "\udcff.csv"
    (folder / "mixed" / "sort.csv").rename(record)
    assert "mixed/\\udcff" in run(record, "--png", tmp_path / "a.png")


def test_what_cannot_be_shown_is_an_error(folder, tmp_path):
    (tmp_path / "none").mkdir()
    with pytest.raises(UsageError, match="no record found"):
        run(tmp_path / "none")
    with pytest.raises(FileError, match=r"gone\.csv: cannot be read"):
        run(tmp_path / "gone.csv")
    (tmp_path / "bad.csv").write_text("1.0\nabc\n")
    with pytest.raises(FileError, match=r"bad\.csv:2"):
        run(tmp_path / "bad.csv")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "x.csv").write_text("1.0\n")
    with pytest.raises(UsageError, match=r"none of its records \(mine/x, \.\.\.\)"):
        run(folder, "--compare", tmp_path / "mine")
    with pytest.raises(UsageError, match="written as png"):
        run(folder / "mixed" / "sort.csv", "--png", tmp_path / "h.pdf")


def test_the_number_of_bins_has_limits(folder):
    result = CliRunner().invoke(application, [str(folder), "--bins", "0"])
    assert result.exit_code == 2
