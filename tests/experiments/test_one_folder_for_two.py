"""Two experiments at the same time do not mix their files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import deploy
from reconros_zenoh.cli.main import _application
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.provenance import own_folder

DEPLOYMENT = Path(deploy.__file__).with_name("roundtrip.yaml")
COMMANDS = {
    "experiment roundtrip --clock virtual --requests 1": "virtual",
    "experiment design --clock virtual": "virtual",
    "experiment gateway": "",
    "simulate -f DEPLOYMENT": "",
}


@pytest.mark.parametrize(("command", "folder"), COMMANDS.items())
def test_a_folder_that_another_experiment_writes_to_is_refused(
    command: str, folder: str, tmp_path: Path
) -> None:
    (tmp_path / folder).mkdir(exist_ok=True)
    kept = tmp_path / folder / "experiment.json"
    kept.write_text("of the other", encoding="utf-8")
    given = [str(DEPLOYMENT) if word == "DEPLOYMENT" else word for word in command.split()]
    words = [*given, "--out", str(tmp_path)]
    with own_folder(tmp_path / folder):
        done = CliRunner().invoke(_application(words[:1]), words)
    assert isinstance(done.exception, UsageError)
    assert f"another experiment is writing to {tmp_path / folder}" in str(done.exception)
    assert kept.read_text(encoding="utf-8") == "of the other"


def test_the_folder_is_free_again(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), own_folder(tmp_path / "new"):
        raise ZeroDivisionError
    with own_folder(tmp_path / "new"), pytest.raises(UsageError, match=re.escape(str(tmp_path))):
        own_folder(tmp_path / "new").__enter__()
    with own_folder(tmp_path / "new"):
        pass


def test_of_a_folder_in_which_nothing_was_written_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    for folder in ("there", "new/one"):
        with pytest.raises(ZeroDivisionError), own_folder(tmp_path / folder):
            raise ZeroDivisionError
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
    with own_folder(tmp_path / "new/one"):
        (tmp_path / "new/one/kept").touch()
    assert (tmp_path / "new/one/kept").exists()


def test_a_folder_in_which_nothing_can_be_written_is_refused_before_anything_is_measured() -> None:
    """Of /proc that holds for root, too."""
    with pytest.raises(UsageError, match=r"/proc cannot be written \(.*\)\. Choose another --out\."):
        own_folder(Path("/proc")).__enter__()
