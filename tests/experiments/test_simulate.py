"""`reconros simulate`: a deployment in one process in virtual time."""

from __future__ import annotations

import json
import os
from pathlib import Path
from shlex import quote
from shutil import copytree
from typing import TYPE_CHECKING

import pytest
import typer
from typer.testing import CliRunner

from host_clients.daemon import ClientOptions
from reconros_zenoh.board.answers import StatusAnswer
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.service_commands import read_deployment
from reconros_zenoh.cli.simulate import simulate
from reconros_zenoh.errors import FileError, TransportError, UsageError
from reconros_zenoh.experiments.deployment import DeploymentRun
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.measure.record import RoundTrip

ROOT = Path(__file__).parents[2]
ROUNDTRIP = ROOT / "deploy" / "roundtrip.yaml"
DESIGN = ROOT / "deploy" / "design_example.yaml"
DRIVING = ROOT / "deploy" / "driving.yaml"
CLIENTS = {"sort", "inverse", "sobel", "mnist", "hash"}
CELL_KEYS = {"n", "lost", "wrong", "median_ms", "p95_ms", "p99_ms"}
ECHO = ROOT / "tests" / "benchmarks" / "echo"
BOARD = "reconros board"

application = typer.Typer()
application.command("simulate")(simulate)


def run(*arguments: object, status: int = 0) -> str:
    """Return what the command prints; raise what it raises."""
    result = CliRunner().invoke(application, [str(argument) for argument in arguments], env={"COLUMNS": "80"})
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == status, result.output
    return result.stdout


def records(folder: Path) -> dict[str, bytes]:
    """Return the content of all files below a folder by their paths in it."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def write_deployment(folder: Path, *commands: str, more: str = "") -> Path:
    """Write a Compose file with the services s0, s1, ... and return its path; `more` belongs to the last."""
    services = "".join(f"  s{number}:\n    command: {command}\n" for number, command in enumerate(commands))
    path = folder / "file.yaml"
    path.write_text(f"services:\n{services}{more}", encoding="utf-8")
    return path


def test_the_file_of_up_gives_a_record_and_a_row_per_board_and_client(tmp_path: Path) -> None:
    output = run("-f", ROUNDTRIP, "--requests", 3, "--out", tmp_path)
    assert records(tmp_path).keys() == {f"board0/{client}.csv" for client in CLIENTS}
    rows = [line.split() for line in output.splitlines() if line.startswith("board0")]
    assert {row[1]: row[2:5] for row in rows} == {client: ["3", "0", "0"] for client in CLIENTS}


def test_the_design_example_is_simulated_from_the_file_of_up(tmp_path: Path) -> None:
    output = run("-f", DESIGN, "--requests", 10, "--out", tmp_path, "--json")
    board = json.loads(output)["boards"]["vision+control"]
    assert records(tmp_path).keys() == {f"vision+control/{name}.csv" for name in ("viewer", "viewer_control")}
    assert 0 < board["viewer"]["n"] <= 10
    assert board["viewer_control"]["n"] > 15
    assert {cell["wrong"] for cell in board.values()} == {0}


def test_the_driving_example_is_simulated_from_the_file_of_up(tmp_path: Path) -> None:
    output = run("-f", DRIVING, "--requests", 5, "--out", tmp_path, "--json")
    assert records(tmp_path).keys() == {"board0/robot.csv"}
    cell = json.loads(output)["boards"]["board0"]["robot"]
    assert (cell["n"], cell["lost"], cell["wrong"]) == (5, 0, 0)


def test_a_board_is_of_the_kind_that_its_project_is_built_for(tmp_path: Path) -> None:
    driving = ROOT / "reconros_zenoh" / "applications" / "driving"
    profiles = []
    for options in ("", "--profile=miniitx-zynq7100"):
        file = write_deployment(tmp_path, f"{BOARD} {driving} {options}", "reconros robot")
        profiles.append(read_deployment(file, {}).boards["s0"].profile.name)
    assert profiles == ["zcu104", "miniitx-zynq7100"]


def test_a_relative_path_counts_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "echo").symlink_to(ECHO)
    file = write_deployment(
        tmp_path / "elsewhere", f"{BOARD} echo --profile=miniitx-zynq7100", "reconros client sort"
    )
    monkeypatch.chdir(tmp_path)
    assert read_deployment(file, {}).boards["s0"].project.configuration.name == "echo"
    monkeypatch.chdir(tmp_path / "elsewhere")
    with pytest.raises(FileError, match=f"in a Compose file too, count from {tmp_path}/elsewhere"):
        read_deployment(file, {})


def test_a_robot_in_a_domain_without_a_board_is_refused(tmp_path: Path) -> None:
    file = write_deployment(tmp_path, BOARD, "reconros robot --domain=3")
    with pytest.raises(FileError, match=r"file\.yaml:5: .* asks in domain 3, where no board is"):
        run("-f", file, "--out", tmp_path)


def test_a_camera_in_a_domain_without_a_board_is_refused(tmp_path: Path) -> None:
    file = write_deployment(tmp_path, BOARD, "reconros camera --domain=3")
    with pytest.raises(FileError, match=r"file\.yaml:5: .* asks in domain 3, where no board is"):
        run("-f", file, "--out", tmp_path)


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path: Path) -> None:
    outputs = {}
    for name, seed in (("first", 1), ("second", 1), ("other", 2)):
        arguments = ("--requests", 10, "--seed", seed, "--out", tmp_path / name, "--json")
        outputs[name] = run("-f", ROUNDTRIP, *arguments)
    assert records(tmp_path / "first") == records(tmp_path / "second")
    assert outputs["first"] == outputs["second"]
    assert records(tmp_path / "first")["board0/sobel.csv"] != records(tmp_path / "other")["board0/sobel.csv"]


def test_what_was_measured_before_an_interruption_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(simulation: Simulation, _: float | None) -> None:
        simulation.environment.run(until=2_000_000_000)
        raise KeyboardInterrupt

    monkeypatch.setattr(Simulation, "run", interrupted)
    answer = json.loads(run("-f", ROUNDTRIP, "--requests", 1000, "--out", tmp_path, "--json", status=130))
    assert (answer["interrupted"], answer["simulated_s"]) == (True, 2)
    shown = run("-f", ROUNDTRIP, "--requests", 1000, "--out", tmp_path, status=130)
    assert shown.endswith("interrupted before its end\n")
    assert answer["status"]["board0"]["elapsed_ms"] == 2000
    cells = answer["boards"]["board0"]
    assert 0 < cells["inverse"]["n"] < 1000
    for name, content in records(tmp_path).items():
        assert content.count(b",ok\n") == cells[Path(name).stem]["n"]


def test_the_json_names_boards_and_services(tmp_path: Path) -> None:
    answer = json.loads(run("-f", ROUNDTRIP, "--boards", 2, "--requests", 2, "--out", tmp_path, "--json"))
    assert answer.keys() == {"file", "simulated_s", "boards", "all_boards", "status", "interrupted"}
    assert answer["status"].keys() == {"board0-0", "board0-1"}
    assert {client: cell["n"] for client, cell in answer["all_boards"].items()} == dict.fromkeys(CLIENTS, 4)
    slowest = [services["sobel"]["max_ms"] for services in answer["boards"].values()]
    assert answer["all_boards"]["sobel"]["max_ms"] == max(slowest)
    assert answer["interrupted"] is False
    assert answer["simulated_s"] > 0
    assert answer["boards"].keys() == {"board0-0", "board0-1"}
    for services in answer["boards"].values():
        assert services.keys() == CLIENTS
        assert all(cell.keys() >= CELL_KEYS and cell["n"] == 2 for cell in services.values())


def test_boards_without_clients_run_for_as_long_as_is_said(tmp_path: Path) -> None:
    file = write_deployment(tmp_path, f"{BOARD} --name one", f"{BOARD} --name two --domain 1")
    arguments = ("-f", file, "--seconds", 1.1, "--out", tmp_path / "out")
    answer = json.loads(run(*arguments, "--json"))
    assert (answer["simulated_s"], answer["boards"], answer["all_boards"]) == (1.1, {}, {})
    # A timer of the round-trip application expires every 250 ms.
    calls = {name: status["callbacks"]["hash"]["calls"] for name, status in answer["status"].items()}
    assert calls == {"one": 4, "two": 4}
    for status in answer["status"].values():
        StatusAnswer.model_validate(status)
    shown = run(*arguments)
    heads = [line.split(":")[0] for line in shown.splitlines() if line.startswith("board ")]
    assert heads == ["board one", "board two"]
    assert shown.endswith("\n1.1 s of virtual time\n")


def test_with_clients_it_ends_at_that_time_with_what_they_have(tmp_path: Path) -> None:
    shown = run("-f", ROUNDTRIP, "--requests", 10_000, "--seconds", 5, "--out", tmp_path)
    lines = shown.splitlines()
    rows = [line.split() for line in lines if line.startswith("board0 ")]
    assert {row[1] for row in rows} == CLIENTS
    assert all(0 < int(row[2]) < 10_000 for row in rows)
    # What the board has done stands below what the clients saw.
    (below,) = (number for number, line in enumerate(lines) if line.startswith("board board0: profile"))
    assert below > lines.index("Times in ms.")
    assert lines[-1].startswith("5.0 s of virtual time; ")


def test_clones_are_told_apart_in_the_json_alone(tmp_path: Path) -> None:
    file = write_deployment(tmp_path, BOARD)
    shown = run("-f", file, "--boards", 2, "--seconds", 0.5, "--out", tmp_path / "out")
    assert shown == "0.5 s of virtual time\n"


def test_what_each_board_did_is_traced_to_a_file_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TRACE", str(tmp_path / "trace.json"))
    run("-f", ROUNDTRIP, "--boards", 2, "--requests", 1, "--out", tmp_path / "out")
    for number in range(2):
        events = json.loads((tmp_path / f"trace-{number}.json").read_text())["traceEvents"]
        assert events[0]["args"]["name"] == f"board0-{number}"
        names = {event["args"]["name"] for event in events if event["name"] == "thread_name"}
        assert names == {"software 0", "software 1", *(f"RS{n}" for n in range(4)), "ICAP", "DDS stack"}
        calls = {event["name"] for event in events if event.get("cat") == "call"}
        assert calls == {*CLIENTS, "in", "out"}


def test_clones_do_not_notice_each_other() -> None:
    plan = read_deployment(ROUNDTRIP, os.environ).changed(10, 7)
    together = DeploymentRun([plan.clone(number) for number in range(3)])
    together.run(lambda: None)
    for number in range(3):
        alone = DeploymentRun([plan.clone(number)])
        alone.run(lambda: None)
        assert alone.round_trips == {f"board0-{number}": together.round_trips[f"board0-{number}"]}
    first, second, _ = together.round_trips.values()
    assert first["sobel"] != second["sobel"]


def test_a_client_talks_to_the_board_of_its_domain(tmp_path: Path) -> None:
    file = write_deployment(
        tmp_path,
        "reconros router --listen tcp/[::]:7447",
        f"{BOARD} --name one --domain 1",
        f"{BOARD} --name two --domain 2",
        "reconros client inverse --domain 1 --requests 2",
        "reconros client inverse --requests 3",
        "reconros client sort --requests 4 --domain 1",
        more="    environment:\n      ROS_DOMAIN_ID: 2\n",
    )
    text = file.read_text(encoding="utf-8")
    file.write_text(
        text.replace("--requests 3\n", "--requests 3\n    environment: [ROS_DOMAIN_ID=2]\n"), encoding="utf-8"
    )
    boards = json.loads(run("-f", file, "--out", tmp_path / "out", "--json"))["boards"]
    counts = {
        board: {service: cell["n"] for service, cell in services.items()}
        for board, services in boards.items()
    }
    assert counts == {"one": {"s3": 2, "s5": 4}, "two": {"s4": 3}}


def first_sort_ns(group: str | None) -> int:
    """Return when a sort client has its first answer that counts, beside a hash client."""
    project = load_project(application_folder())
    done_ns: list[int] = []
    with Simulation(project.types()) as simulation:
        mapping = project.mapping("all_hardware")
        simulation.add_board(read_profile("miniitx-zynq7100"), project, mapping, BoardOptions())
        recorders: dict[str, Callable[[RoundTrip], None]] = {
            "sort": lambda _: done_ns.append(simulation.environment.now),
            "hash": lambda _: None,
        }
        for name, record in recorders.items():
            simulation.add_client(ClientOptions(name, 1, group=group, members=2), record)
        simulation.run()
    assert len(done_ns) == 1
    return done_ns[0]


def test_clients_of_a_group_begin_together() -> None:
    # The board hashes every 250 ms, so before that the hash client has had no answer.
    assert first_sort_ns(None) < 250_000_000 < first_sort_ns("group")


@pytest.mark.parametrize(
    ("commands", "problem"),
    [
        ([BOARD, "sleep 1"], r"file\.yaml:5: services\.s1\.command cannot be simulated: 'sleep 1'"),
        ([BOARD, "reconros status"], r"services\.s1\.command cannot be simulated"),
        (["reconros"], r"services\.s0\.command cannot be simulated"),
        ([f"{BOARD} --colour=red"], r"file\.yaml:3: services\.s0\.command cannot be run: No such option"),
        ([f"{BOARD} --help"], r"services\.s0\.command cannot be run: No such option"),
        ([BOARD, "reconros client painter"], r"services\.s1\.command cannot be run: .*'painter'"),
        ([BOARD, "reconros client sort --requests 0"], r"services\.s1\.command cannot be run: .*--requests"),
        ([f"{BOARD} --mapping=nowhere"], r"services\.s0\.command cannot be run: no mapping named 'nowhere'"),
        ([f"{BOARD} --name=a+b"], r"file\.yaml:3: services\.s0\.command cannot be run: 'a\+b' cannot name"),
        ([f"{BOARD} --profile=nothing"], r"services\.s0\.command cannot be run: .*nothing"),
        ([f"{BOARD} --profile=native"], r"services\.s0\.command runs on native"),
        ([f"{BOARD} {ECHO}"], r"services\.s0\.command runs on native"),
        ([BOARD, BOARD], r"services\.s1\.command names a second board 'board0'"),
        ([BOARD], r"file\.yaml:2: .*no clients.* --seconds"),
        (["reconros router"], r"no boards"),
        ([BOARD, "reconros client sort --domain 3"], r"services\.s1\.command asks in domain 3"),
        ([BOARD, "reconros client sort --group g --members 2"], r"services\.s1\.command waits for 2 clients"),
        ([BOARD, "reconros client sort --group '*'"], r"services\.s1\.command cannot be run: .*'\*' cannot"),
        ([BOARD, "reconros camera --group g --members 2"], r"services\.s1\.command waits for 2 clients"),
    ],
)
def test_what_cannot_be_simulated_is_named_with_its_service(
    tmp_path: Path, commands: list[str], problem: str
) -> None:
    with pytest.raises(FileError, match=problem):
        run("-f", write_deployment(tmp_path, *commands), "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_service_that_waits_for_the_end_of_another_is_refused(tmp_path: Path) -> None:
    file = write_deployment(
        tmp_path,
        BOARD,
        "reconros client sort",
        "reconros client hash",
        more="    depends_on:\n      s1:\n        condition: service_completed_successfully\n",
    )
    with pytest.raises(FileError, match=r"services\.s2 waits for the end of another service"):
        run("-f", file, "--out", tmp_path / "out")


def test_a_client_whom_nobody_answers_is_named(tmp_path: Path) -> None:
    project = tmp_path / "project"
    copytree(application_folder(), project)
    path = project / "build.cfg"
    path.write_text(path.read_text(encoding="utf-8").replace('"sorter"', '"other"'), encoding="utf-8")
    file = write_deployment(tmp_path, f"{BOARD} {project}", "reconros client sort --wait 5 --limit 1")
    with pytest.raises(TransportError, match="no board answered the sort client in domain 0 within 5 s"):
        run("-f", file, "--out", tmp_path / "out")


def test_a_board_that_cannot_host_its_project_is_named(tmp_path: Path) -> None:
    board = f"{BOARD} {quote(str(ECHO))} --profile=miniitx-zynq7100"
    file = write_deployment(tmp_path, board, "reconros client sort")
    with pytest.raises(
        UsageError, match=r"s0: .*/main\.py:20: profile 'miniitx-zynq7100' has no times for callback 'number'"
    ):
        run("-f", file, "--out", tmp_path / "out")


def test_a_folder_that_cannot_be_made_is_an_error_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(UsageError, match="Choose another --out"):
        run("-f", ROUNDTRIP, "--out", tmp_path / "out")


def test_more_boards_than_memory_holds_are_refused(tmp_path: Path) -> None:
    words = ["-f", str(ROUNDTRIP), "--boards", "1000000000", "--out", str(tmp_path)]
    done = CliRunner().invoke(application, words)
    assert done.exit_code == 2
    assert "Invalid value for '--boards'" in done.stderr
