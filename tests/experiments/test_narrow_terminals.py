"""Tables on a terminal that is too narrow for them keep their digits."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from reconros_zenoh.cli.main import _VERBS, _application
from reconros_zenoh.experiments.roundtrip import application_folder

application = _application(list(_VERBS))


@pytest.mark.parametrize(
    "command",
    [
        "experiment callbacks --repeat 1",
        "experiment reconfiguration --writes 1",
        "run PROJECT --clock virtual --seconds 0.1",
        "map PROJECT",
    ],
)
def test_a_narrow_terminal_gets_what_one_of_80_columns_gets(command: str) -> None:
    words = [str(application_folder()) if word == "PROJECT" else word for word in command.split()]
    narrow, usual = (
        CliRunner().invoke(application, words, env={"COLUMNS": columns}) for columns in ("40", "80")
    )
    assert narrow.stdout == usual.stdout
    assert "─" in narrow.stdout
    assert "\x1b" not in narrow.output
