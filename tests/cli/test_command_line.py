"""The command line as a whole: its help, its options, its end."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from importlib.metadata import version
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from reconros_zenoh.cli.main import _VERBS, Formatter, _application
from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from pathlib import Path

application = _application(list(_VERBS))


@pytest.mark.parametrize("group", [(), ("experiment",)])
def test_the_list_of_commands_cuts_no_sentence(group: tuple[str, ...]) -> None:
    shown = CliRunner().invoke(application, [*group, "--help"], env={"COLUMNS": "78"}).stdout
    lines = shown.partition("Commands:\n")[2].splitlines()
    assert len(lines) >= 5
    assert [line for line in lines if not line.endswith(".") or line.endswith("..")] == []


@pytest.mark.parametrize("command", [[], ["board"], ["experiment"], ["experiment", "roundtrip"]])
def test_h_is_short_for_help(command: list[str]) -> None:
    done = CliRunner().invoke(application, [*command, "-h"])
    assert done.exit_code == 0
    assert done.stdout == CliRunner().invoke(application, [*command, "--help"]).stdout


def test_it_says_its_versions() -> None:
    done = CliRunner().invoke(application, ["--version"])
    assert done.exit_code == 0
    assert f"reconros-zenoh {version('reconros-zenoh')}\n" in done.stdout
    assert f"eclipse-zenoh {version('eclipse-zenoh')}\n" in done.stdout


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


def reconros(words: str, redirected: str = "") -> subprocess.CompletedProcess[str]:
    """Run a command in a shell that redirects its streams."""
    line = f"exec '{sys.executable}' -m reconros_zenoh {words} {redirected}"
    return subprocess.run(line, shell=True, capture_output=True, timeout=120, check=False, text=True)


def test_an_error_is_an_object_where_json_is_asked_for() -> None:
    done = reconros("check nowhere --json")
    (line,) = done.stderr.splitlines()
    assert (done.returncode, line) == (2, f"reconros: {json.loads(done.stdout)['error']}")
    assert "nowhere: cannot be read" in line


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (
            "experiment roundtrip --requests 0",
            "Invalid value for '--requests': Input should be greater than or equal to 1",
        ),
        (
            "client sort --group '*'",
            "Invalid value for '--group': '*' cannot name a group. Use letters, digits, `-`, `_` and `.`.",
        ),
        ("hist", "Missing argument 'DIR|FILE...'."),
        ("reconstruct", "No such command 'reconstruct'."),
    ],
)
def test_an_error_in_the_arguments_is_one_too(words: str, error: str) -> None:
    done = reconros(f"{words} --json")
    assert (done.returncode, json.loads(done.stdout)) == (2, {"error": error})
    assert done.stderr.startswith("Usage: reconros")
    assert done.stderr.endswith(f"Error: {error}\n")


def test_an_error_does_not_tell_the_terminal_what_to_do() -> None:
    done = reconros("map \"$(printf '\\033]0;mine\\007.yaml')\"")
    assert done.returncode == 2
    assert done.stderr == (
        "reconros: \\x1b]0;mine\\x07.yaml: cannot be read: No such file or directory. "
        "Give a readable YAML file.\n"
    )


def test_a_log_line_is_one_line_without_control_characters() -> None:
    text = "a\nWARNING b \x1b[2J" + 3000 * "x"
    record = logging.LogRecord("a.b", logging.WARNING, "", 1, "refused %s", (text,), None)
    line = Formatter().format(record)
    assert line.startswith(r"WARNING a.b: refused a\nWARNING b \x1b[2Jxxx")
    assert line.isprintable()
    assert 2000 < len(line) < 2050


def test_a_log_line_of_a_board_says_when() -> None:
    record = logging.LogRecord("reconros_zenoh.board0.filter", logging.INFO, "", 1, "no lane", (), None)
    record.elapsed_ms = 1234.5678
    assert Formatter().format(record) == "INFO reconros_zenoh.board0.filter at 1234.568 ms: no lane"


@pytest.mark.parametrize("words", ["--help", "hist {record}", "hist {record} --json", "check nowhere --json"])
def test_a_full_disk_is_told_in_a_line(words: str, tmp_path: Path) -> None:
    record = tmp_path / "times.csv"
    record.write_text("1.0\n2.0\n", encoding="utf-8")
    done = reconros(words.format(record=record), ">/dev/full")
    last = done.stderr.splitlines()[-1]
    assert (done.returncode, last) == (
        1,
        "reconros: the output cannot be written: No space left on device",
    )
    assert "Traceback" not in done.stderr


def test_a_file_that_nobody_foresaw_is_told_as_other_errors_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A state folder below a file: what a command stumbles over is an object, too."""
    file = tmp_path / "compose.yaml"
    file.write_text("services: {}\n", encoding="utf-8")
    monkeypatch.setenv("XDG_STATE_HOME", str(file))
    done = reconros(f"down -f {file} --json")
    told = json.loads(done.stdout)["error"]
    assert (done.returncode, done.stderr) == (2, f"reconros: {told}\n")
    assert told.startswith(f"{file}/reconros/")
    assert told.endswith("/lock: Not a directory. Check the path and its permissions.")


def test_letters_that_a_drawing_has_not_leave_no_warning(tmp_path: Path) -> None:
    record = tmp_path / "\u8a08\u6e2c.csv"
    record.write_text("1.0\n2.0\n", encoding="utf-8")
    done = reconros(f"hist {record} --png {tmp_path / 'times.png'}")
    assert (done.returncode, done.stderr) == (0, "")


def test_closed_streams_do_not_matter(tmp_path: Path) -> None:
    record = tmp_path / "times.csv"
    record.write_text("1.0\n2.0\n", encoding="utf-8")
    done = reconros(f"hist {record} --png {tmp_path / 'times.png'}", "<&- >&- 2>&-")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "times.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("encoding", "name", "shown"),
    [("latin-1", "\u2192".encode(), b"\\u2192"), ("utf-8", b"\xff", b"\\udcff")],
    ids=["an arrow in latin-1", "what is no UTF-8"],
)
def test_a_path_that_stdout_has_no_letters_for(
    encoding: str, name: bytes, shown: bytes, tmp_path: Path
) -> None:
    (tmp_path / "times.csv").write_text("1.0\n2.0\n", encoding="utf-8")
    drawing = os.fsdecode(name + b".png")
    command = [sys.executable, "-m", "reconros_zenoh", "hist", "times.csv", "--png", drawing]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(sys.path),
        "PYTHONUTF8": "1",
        "PYTHONIOENCODING": encoding,
    }
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.endswith(b"drawn to " + shown + b".png\n")
    assert {path.name for path in tmp_path.iterdir()} == {"times.csv", drawing}
