"""The command line as a whole: its help, its options, its end."""

from __future__ import annotations

import subprocess
import sys

import pytest
from typer.testing import CliRunner

from reconros_zenoh.cli.main import _VERBS, _application
from reconros_zenoh.errors import UsageError

application = _application(list(_VERBS))


@pytest.mark.parametrize("group", [(), ("experiment",)])
def test_the_list_of_commands_cuts_no_sentence(group: tuple[str, ...]) -> None:
    shown = CliRunner().invoke(application, [*group, "--help"], env={"COLUMNS": "78"}).stdout
    lines = shown.partition("Commands:\n")[2].splitlines()
    assert len(lines) >= 5
    assert [line for line in lines if not line.endswith(".") or line.endswith("..")] == []


@pytest.mark.parametrize(
    "command",
    [
        "experiment roundtrip",
        "experiment design",
        "calibrate --profile native --data data --out profile.toml",
        "simulate -f file.yaml",
        "board",
        "client sort",
        "run project",
    ],
)
def test_a_negative_seed_is_refused(command: str) -> None:
    done = CliRunner().invoke(application, [*command.split(), "--seed", "-1"])
    assert done.exit_code == 2
    assert "'--seed'" in done.stderr
    assert "greater than or equal to 0" in done.stderr


def test_a_signal_while_a_verb_is_imported_ends_it_quietly() -> None:
    # The import itself is too short to be hit.
    program = """
import reconros_zenoh.cli.main as cli
def _application(verbs):
    raise KeyboardInterrupt
cli._application = _application
cli.main()
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, timeout=120, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"")


@pytest.mark.parametrize(
    ("module", "usage"),
    [
        ("board_daemon", "reconros board [OPTIONS] [project]"),
        ("host_clients", "reconros client [OPTIONS] {name}"),
        ("reconros_zenoh", "reconros [OPTIONS] COMMAND [ARGS]..."),
    ],
)
def test_a_package_that_is_run_says_how_it_is_called(module: str, usage: str) -> None:
    command = [sys.executable, "-m", module, "--help"]
    done = subprocess.run(command, capture_output=True, timeout=120, check=True, text=True)
    assert done.stdout.startswith(f"Usage: {usage}\n")


def test_a_gateway_needs_a_type() -> None:
    done = CliRunner().invoke(application, ["gateway", "--hmt", "/a"])
    assert isinstance(done.exception, UsageError)
    assert "Add for example --type sensor_msgs/Image" in str(done.exception)
