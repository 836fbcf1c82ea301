"""`reconros up` and `reconros down` as processes, with their state in a temporary folder."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import psutil
import pytest
from rich.console import Console

from deploy.compose import Healthcheck
from deploy.logs import LogReader, last_lines
from deploy.service_run import ServiceState
from deploy.state import StateFolder
from reconros_zenoh.cli.service_screen import ServiceScreen
from reconros_zenoh.errors import FileError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from conftest import Services

    Popen = subprocess.Popen[str]
    Start = Callable[..., Popen]
    Run = Callable[..., subprocess.CompletedProcess[str]]

PROGRAM = """
import sys, typer
from reconros_zenoh.cli.up import down, up
from reconros_zenoh.errors import ReconrosError, UsageError
app = typer.Typer()
app.command()(up)
app.command()(down)
try:
    app()
except ReconrosError as error:
    print(error, file=sys.stderr)
    sys.exit(2 if isinstance(error, UsageError) else 1)
"""


@pytest.fixture
def start(tmp_path: Path) -> Start:
    """Return a function that starts `up` or `down`: for the Compose file of the test, or for `file`."""

    def start_command(verb: str, *options: str, file: Path | None = tmp_path / "compose.yaml") -> Popen:
        return subprocess.Popen(
            [sys.executable, "-c", PROGRAM, verb, *([] if file is None else ["-f", str(file)]), *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(sys.path),
                "XDG_STATE_HOME": str(tmp_path / "state"),
                "COLUMNS": "80",
            },
        )

    return start_command


@pytest.fixture
def run(start: Start) -> Iterator[Run]:
    """Return a function that runs `up` or `down` to its end; after the test it is stopped."""

    def run_command(verb: str, *options: str, **given: Any) -> subprocess.CompletedProcess[str]:
        with start(verb, *options, **given) as process:
            output, errors = process.communicate()
            return subprocess.CompletedProcess(process.args, process.returncode, output, errors)

    yield run_command
    run_command("down")


def _server_and(services: Services, client: str) -> None:
    services.compose_file(
        services.service("server", "print('open'); write('r'); block()", services.when_written("r")),
        services.service("client", client, server="healthy"),
    )


def _supervisor(services: Services) -> psutil.Process:
    return psutil.Process(int((services.folder / "server.pid").read_text())).parent()


def test_up_ends_with_0_when_all_services_do(services: Services, run: Run) -> None:
    services.compose_file(
        services.service("one", "print('first'); sys.stdout.write('no end of line')"),
        services.service("three", "print('[bold]not markup', ' ' * 100, '|')", one="completed_successfully"),
    )
    done = run("up")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "one: started",
        "one   | first",
        "one   | no end of line",
        "one: ended",
        "three: started",
        f"three | [bold]not markup {' ' * 100} |",
        "three: ended",
    ]
    assert "Nothing" not in run("down").stdout


def test_up_names_the_service_that_failed(services: Services, run: Run) -> None:
    _server_and(services, "print('oh no'); sys.exit(7)")
    done = run("up")
    assert done.returncode == 1
    assert done.stderr.startswith("Service client ended with status 7.\n")
    assert done.stderr.endswith("    oh no\n")
    assert "server: stopped\n" in done.stdout
    services.assert_gone()


def test_up_prints_only_json_when_told_to(services: Services, run: Run) -> None:
    _server_and(services, "sys.exit(7)")
    done = run("up", "--json")
    result = json.loads(done.stdout)
    assert done.returncode == 1
    assert result["services"] == {"server": "stopped", "client": "failed"}
    assert result["error"].startswith("Service client ended with status 7.")
    assert (services.folder / result["logs"] / "server.log").read_text() == "open\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_ctrl_c_stops_all(services: Services, start: Start, number: signal.Signals) -> None:
    _server_and(services, "block()")
    with start("up") as process:
        assert process.stdout is not None
        assert any(line == "client: started\n" for line in process.stdout)
        process.send_signal(number)
        output, errors = process.communicate()
        assert (process.returncode, errors) == (130, "")
    states = [line for line in output.splitlines() if line.endswith(": stopped")]
    assert states == ["client: stopped", "server: stopped"]
    services.assert_gone()


def test_up_ends_when_nobody_reads_what_it_prints(services: Services, start: Start) -> None:
    closed = services.folder / "closed"
    os.mkfifo(closed)
    talking = "(folder / 'closed').read_text()\nprint('x', flush=True)\nblock()"
    services.compose_file(services.service("one", talking))
    with start("up") as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()
        closed.write_text("")  # now it may print
        assert process.wait() == 130
    services.assert_gone()


def test_down_stops_what_up_has_left_running(services: Services, run: Run) -> None:
    _server_and(services, "block()")
    up = run("up", "-d")
    assert (up.returncode, up.stderr) == (0, "")
    assert up.stdout.splitlines()[:3] == ["server: started", "server: healthy", "client: started"]
    assert _supervisor(services).is_running()

    for options in ([], ["-d"]):
        again = run("up", *options)
        assert again.returncode == 2
        assert "is up already" in again.stderr
        assert f"reconros down -f {services.folder / 'compose.yaml'}" in again.stderr

    down = run("down", "--json")
    assert down.returncode == 0
    assert json.loads(down.stdout)["services"] == {"server": "stopped", "client": "stopped"}
    services.assert_gone()
    nothing = run("down")
    assert (nothing.returncode, nothing.stdout) == (
        0,
        f"Nothing of {services.folder / 'compose.yaml'} is running.\n",
    )


def test_how_to_stop_it_can_be_given_to_a_shell(services: Services, run: Run) -> None:
    _server_and(services, "block()")
    (services.folder / "compose.yaml").rename(file := services.folder / "my garden.yaml")
    up, again = run("up", "-d", file=file), run("up", file=file)
    down = run("down", file=file)
    assert f"Stop it with: reconros down -f '{file}'" in up.stdout.replace("\n", " ")
    assert f"Stop it first: reconros down -f '{file}'" in again.stderr
    assert down.returncode == 0
    services.assert_gone()


def test_down_without_a_file_stops_the_one_that_is_running(
    services: Services, run: Run, tmp_path: Path
) -> None:
    _server_and(services, "block()")
    other = tmp_path / "other.yaml"
    other.write_text((services.folder / "compose.yaml").read_text())
    assert run("up", "-d").returncode == 0
    assert run("up", "-d", file=other).returncode == 0
    try:
        unclear = run("down", file=None)
        assert unclear.returncode == 2
        assert f"-f {services.folder / 'compose.yaml'} or -f {other}" in unclear.stderr
    finally:
        assert run("down", file=other).returncode == 0

    down = run("down", file=None)
    assert (down.returncode, down.stdout) == (0, "server: stopped\nclient: stopped\n")
    services.assert_gone()
    assert run("down", file=None).stdout == "Nothing is running.\n"
    assert json.loads(run("down", "--json", file=None).stdout) == {
        "file": None,
        "logs": None,
        "services": {},
        "error": "",
    }


@pytest.mark.parametrize("options", [(), ("--json",)])
def test_down_of_a_file_that_is_not_there_is_a_mistake(
    run: Run, tmp_path: Path, options: tuple[str, ...]
) -> None:
    misspelt = tmp_path / "misspelt.yaml"
    down = run("down", *options, file=misspelt)
    assert (down.returncode, down.stdout) == (2, "")
    assert down.stderr == f"{misspelt}: is not there, and nothing of it is running. Correct the name.\n"


def test_down_stops_what_runs_of_a_file_that_is_gone(services: Services, run: Run) -> None:
    _server_and(services, "block()")
    assert run("up", "-d").returncode == 0
    (services.folder / "compose.yaml").unlink()
    assert run("down").returncode == 0
    services.assert_gone()


@pytest.mark.parametrize("content", ['{"pid": 1, "states": {}, "error": ""}', ""])
def test_a_record_of_another_version_or_an_empty_one_is_named(
    services: Services, run: Run, tmp_path: Path, content: str
) -> None:
    _server_and(services, "block()")
    folder = StateFolder(services.folder / "compose.yaml", {"XDG_STATE_HOME": str(tmp_path / "state")})
    with folder.claimed():
        pass
    record = folder.path / "record.json"
    record.write_text(content)
    down = run("down")
    assert (down.returncode, down.stdout) == (2, "")
    assert f"{record}: is not what this version of reconros writes." in down.stderr


def test_down_stops_a_foreground_up_too(services: Services, start: Start, run: Run) -> None:
    _server_and(services, "block()")
    with start("up") as process:
        assert process.stdout is not None
        assert any(line == "client: started\n" for line in process.stdout)
        assert run("down").stdout.splitlines() == ["server: stopped", "client: stopped"]
        process.communicate()
        assert process.returncode == 130
    services.assert_gone()


def test_down_stops_a_detached_up_that_waits_for_health_too(
    services: Services, start: Start, run: Run
) -> None:
    services.compose_file(services.service("server", "block()", services.when_written("never")))
    with start("up", "-d") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "server: started\n"
        assert run("down").stdout == "server: stopped\n"
        _, errors = process.communicate()
        assert (process.returncode, errors) == (130, "")
    services.assert_gone()


def test_up_detached_that_fails_leaves_nothing(services: Services, run: Run) -> None:
    never = Healthcheck(("false",), 10**6, retries=1)
    services.compose_file(
        services.service("server", "block()", never), services.service("client", "", server="started")
    )
    done = run("up", "-d", "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["services"]["server"] == "stopped"
    assert done.stderr.startswith("reconros: Service server does not get healthy")
    services.assert_gone()


def test_down_tells_why_it_had_ended_before(services: Services, run: Run) -> None:
    os.mkfifo(services.folder / "pipe")
    _server_and(services, "(folder / 'pipe').open('rb').read(); sys.exit(9)")
    assert run("up", "-d").returncode == 0
    supervisor = _supervisor(services)
    (services.folder / "pipe").write_bytes(b"go on")
    supervisor.wait(timeout=30)
    down = run("down")
    assert down.stdout.startswith(
        "server: stopped\nclient: failed\nIt had failed before: Service client ended with"
    )
    services.assert_gone()


def test_a_killed_supervisor_is_no_obstacle(services: Services, run: Run) -> None:
    _server_and(services, "block()")
    for verb in ("down", "up"):
        (services.folder / "r").unlink(missing_ok=True)
        assert run("up", "-d").returncode == 0
        _supervisor(services).kill()
        services.assert_gone()
        if verb == "down":
            assert "was killed" in run("down").stdout
    assert run("up", "-d").returncode == 0
    assert run("down").stdout.startswith("server: stopped")


@pytest.mark.parametrize(
    ("options", "number"),
    [(["-d"], signal.SIGINT), ([], signal.SIGINT), ([], signal.SIGTERM)],
)
def test_a_signal_while_waiting_for_health_stops_all(
    services: Services, start: Start, options: list[str], number: signal.Signals
) -> None:
    os.mkfifo(services.folder / "pipe")
    services.compose_file(
        services.service(
            "server", "(folder / 'pipe').write_text('x'); block()", services.when_written("never")
        )
    )
    with start("up", *options, "--json") as process:
        assert (services.folder / "pipe").read_text() == "x"
        process.send_signal(number)
        output, errors = process.communicate()
        assert (process.returncode, errors) == (130, "")
    result = json.loads(output)
    assert (result["services"], result["error"]) == ({"server": "stopped"}, "interrupted")
    services.assert_gone()


def test_the_supervisor_does_not_outlive_who_waits_for_it(services: Services, start: Start) -> None:
    os.mkfifo(services.folder / "pipe")
    services.compose_file(
        services.service(
            "server", "(folder / 'pipe').open('rb').read(); write('r'); block()", services.when_written("r")
        )
    )
    with start("up", "-d") as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "server: started\n"
        process.kill()
    (services.folder / "pipe").write_bytes(b"go on")  # the next change of state finds nobody to tell
    services.assert_gone()


def test_a_state_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    folder = StateFolder(tmp_path / "compose.yaml", {"XDG_STATE_HOME": str(tmp_path / "file")})
    with pytest.raises(FileError, match="Set XDG_STATE_HOME"):
        folder.make()


@pytest.mark.parametrize("options", [[], ["-d"]], ids=["foreground", "detached"])
def test_a_full_disk_below_the_state_is_told(services: Services, run: Run, options: list[str]) -> None:
    _server_and(services, "block()")
    state = StateFolder(services.folder / "compose.yaml", {"XDG_STATE_HOME": str(services.folder / "state")})
    state.make()
    (state.path / "record.json.partial").symlink_to("/dev/full")
    (state.path / "supervisor.log").symlink_to("/dev/full")
    up = run("up", *options)
    assert (up.returncode, up.stdout) == (2, "")
    assert up.stderr == (
        f"{state.path / 'record.json'}: cannot be written (No space left on device). "
        "Make room, or set XDG_STATE_HOME to another folder.\n"
    )


def test_a_disk_that_gets_full_does_not_hide_what_failed(services: Services, run: Run) -> None:
    state = StateFolder(services.folder / "compose.yaml", {"XDG_STATE_HOME": str(services.folder / "state")})
    program = f"pathlib.Path({str(state.path)!r}, 'record.json.partial').symlink_to('/dev/full'); sys.exit(9)"
    services.compose_file(services.service("server", program))
    up = run("up")
    assert (up.returncode, up.stderr.splitlines()[0]) == (1, "Service server ended with status 9.")
    assert "found no room to write how it ended" in run("down").stdout


def test_files_of_one_name_have_states_of_their_own(tmp_path: Path) -> None:
    paths = {StateFolder(tmp_path / name / "compose.yaml", {}).path for name in ("a", "b", "a/../a")}
    assert len(paths) == 2


def test_the_terminal_shows_states_below_the_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")  # whatever this test runs in
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=60, soft_wrap=True, color_system=None)
    (tmp_path / "board.log").write_text("\x1b[1mready\x1b[0m\nto serve")
    with ServiceScreen(console, ["router", "board"], tmp_path) as screen:
        screen.show("board", ServiceState.STARTED)
        screen.show("board", ServiceState.FAILED)
    assert screen.states == {"router": ServiceState.WAITING, "board": ServiceState.FAILED}
    shown = text.getvalue()
    assert "board  | ready" in shown
    assert "board  | to serve" in shown
    assert shown.index("to serve") < shown.rindex("router  waiting") < shown.rindex("board   failed")


def test_a_log_is_read_line_by_line(tmp_path: Path) -> None:
    path = tmp_path / "log"
    reader = LogReader(path)
    with path.open("ab", buffering=0) as log:
        assert list(reader.new_lines()) == []
        log.write(b"one\r\ntw")
        assert list(reader.new_lines()) == ["one"]
        log.write(b"o\n\xff\n\nend")
        assert list(reader.new_lines()) == ["two", "\N{REPLACEMENT CHARACTER}", ""]
        assert list(reader.new_lines(all_of_it=True)) == ["end"]
        assert list(reader.new_lines(all_of_it=True)) == []


def test_the_last_lines_of_a_log() -> None:
    many = b"".join(b"%06d\n" % i for i in range(100_000))
    assert last_lines(io.BytesIO(many), 2) == ["099998", "099999"]
    assert last_lines(io.BytesIO(b"a\nb"), 20) == ["a", "b"]
    assert last_lines(io.BytesIO(b""), 20) == []
