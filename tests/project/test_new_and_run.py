"""`reconros new` and `reconros run`: a project from nothing, and on which board it runs."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING, Any

import pytest
import typer
from typer.testing import CliRunner

import reconros_zenoh as rz
from reconros_zenoh.cli.build import build
from reconros_zenoh.cli.new import new
from reconros_zenoh.cli.run import run as run_command
from reconros_zenoh.errors import BitstreamError, FileError, UsageError
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.target import target_profile

if TYPE_CHECKING:
    from pathlib import Path

APPLICATIONS = application_folder().parent

application = typer.Typer()
application.command("new")(new)
application.command("build")(build)
application.command("run")(run_command)


def invoke(*arguments: object) -> str:
    """Return what the command prints on stdout; raise what it raises."""
    result = CliRunner().invoke(application, [str(argument) for argument in arguments])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def run(*arguments: object) -> Any:
    return json.loads(invoke("run", *arguments, "--clock", "virtual", "--json"))


def replace(path: Path, old: str, new: str) -> None:
    """Write `new` for the one `old` in a file."""
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.fixture
def blink(tmp_path: Path) -> Path:
    invoke("new", tmp_path / "blink")
    return tmp_path / "blink"


def test_what_to_try_can_be_given_to_a_shell(tmp_path: Path) -> None:
    folder = tmp_path / "my robots" / "blink"
    assert f"Try it: reconros run '{folder}' --clock virtual" in invoke("new", folder)


def test_a_new_project_is_complete_and_clean(blink: Path) -> None:
    assert sorted(str(path.relative_to(blink)) for path in blink.rglob("*") if path.is_file()) == [
        "build.cfg",
        "callbacks.py",
        "main.py",
        "mappings/hardware.toml",
        "mappings/software.toml",
        "msg/blink_msgs/msg/Count.msg",
    ]
    assert read_build_cfg(blink / "build.cfg").warnings == ()
    assert len((blink / "main.py").read_text(encoding="utf-8").splitlines()) <= 10


def test_it_runs_at_once_in_the_first_mapping_of_its_folder(
    blink: Path, caplog: pytest.LogCaptureFixture
) -> None:
    status = run(blink, "--seconds", 1.05)
    assert (status["profile"], status["interrupted"]) == ("native", False)
    count = status["callbacks"]["count"]
    assert (count["kind"], count["software"], count["slots"]) == ("TMR", False, [0])
    assert (count["calls"], count["failed"], count["dropped"]) == (10, 0, 0)
    assert status["slots"][0]["holds"] == "count"
    assert not caplog.records


def test_it_runs_in_software(blink: Path) -> None:
    assert run(blink, "--mapping", "software", "--seconds", 1.05)["callbacks"]["count"]["slots"] == []


def test_without_mapping_files_what_can_be_runs_in_hardware(blink: Path) -> None:
    for path in (blink / "mappings").iterdir():
        path.unlink()
    count = run(blink, "--seconds", 1.05)["callbacks"]["count"]
    assert (count["software"], count["slots"], count["calls"]) == (False, [0], 10)


def test_the_text_ends_with_the_status(blink: Path) -> None:
    output = invoke("run", blink, "--clock", "virtual", "--seconds", 0.25)
    (row,) = [line.split() for line in output.splitlines() if line.startswith("count  ") and "TMR" in line]
    assert row[-3:] == ["2", "0", "0"]  # calls, failed, dropped


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_shows_what_it_has_done_and_says_so(blink: Path, number: signal.Signals) -> None:
    called = "self.count += 1"
    stops = f"if self.count == 3: __import__('signal').raise_signal({number:d})"
    replace(blink / "callbacks.py", called, f"{called}\n        {stops}")
    former = signal.signal(number, signal.default_int_handler)
    try:
        arguments = ["run", str(blink), "--clock", "virtual", "--seconds", "1e9"]
        text, as_json = (CliRunner().invoke(application, [*arguments, *more]) for more in ([], ["--json"]))
    finally:
        signal.signal(number, former)
    assert (text.exit_code, as_json.exit_code) == (130, 130)
    assert text.stdout.endswith("interrupted before its end\n")
    status = json.loads(as_json.stdout)
    assert (status["interrupted"], status["callbacks"]["count"]["calls"]) == (True, 3)


def test_what_it_did_when_is_traced(blink: Path, tmp_path: Path) -> None:
    path = tmp_path / "traces" / "blink.json"
    command = ("run", blink, "--clock", "virtual", "--seconds", 0.25, "--trace", path)
    assert invoke(*command).endswith(f"what ran where and when is in {path}\n")
    events = json.loads(path.read_text())["traceEvents"]
    assert [event["name"] for event in events if event.get("cat") == "call"] == ["count", "count", "count"]
    with pytest.raises(UsageError, match=r"trace\.txt: a trace is written as \.json"):
        invoke("run", blink, "--clock", "virtual", "--trace", tmp_path / "trace.txt")


def test_times_of_nothing_are_explained(blink: Path) -> None:
    said = "native models nothing, so nothing took any time."
    assert said in invoke("run", blink, "--clock", "virtual", "--seconds", 0.25)
    modelled = invoke("run", application_folder(), "--clock", "virtual", "--seconds", 0.25)
    assert "models nothing" not in modelled


def test_its_target_board_decides_on_the_profile() -> None:
    assert run(application_folder(), "--seconds", 1)["profile"] == "miniitx-zynq7100"
    assert run(application_folder(), "--seconds", 1, "--profile", "native")["profile"] == "native"


def test_a_board_without_a_profile_is_warned_of(blink: Path, caplog: pytest.LogCaptureFixture) -> None:
    replace(blink / "build.cfg", "TargetOS", "TargetBoard = zybo,b\nTargetOS")
    assert run(blink, "--seconds", 1)["profile"] == "native"
    assert "no profile for the board" in caplog.text


@pytest.mark.parametrize("misspelt", ["Slots = slot(0)", "SwSourc = c"])
def test_what_build_cfg_says_in_vain_is_warned_of_once(
    blink: Path, caplog: pytest.LogCaptureFixture, misspelt: str
) -> None:
    replace(blink / "build.cfg", "SwSource = c", f"SwSource = c\n{misspelt}")
    run(blink, "--seconds", 1)
    warnings = [record.getMessage() for record in caplog.records]
    name = misspelt.partition(" ")[0]
    assert [f"the unknown option {name} is left out." in warning for warning in warnings] == [True]


def test_a_callback_without_sources_runs_in_software_as_its_warning_says(
    blink: Path, caplog: pytest.LogCaptureFixture
) -> None:
    replace(blink / "build.cfg", "HwSource = hls\nSwSource = c\n", "")
    (blink / "mappings" / "hardware.toml").unlink()
    (blink / "mappings" / "software.toml").unlink()
    assert run(blink, "--seconds", 1)["callbacks"]["count"]["calls"] > 0
    assert "count has neither HwSource nor SwSource, so it can run in software only." in caplog.text


def test_a_mistake_that_follows_from_a_warning_comes_behind_it(
    blink: Path, caplog: pytest.LogCaptureFixture
) -> None:
    replace(blink / "build.cfg", "ReconosThread@", "ReconosThred@")
    with pytest.raises(FileError, match="no callback 'count'"):
        run(blink)
    assert f"{blink / 'build.cfg'}:24: the unknown section [ReconosThred@count] is left out." in caplog.text


@pytest.mark.parametrize("path", sorted(APPLICATIONS.rglob("build.cfg")), ids=str)
def test_shipped_projects_are_read_without_a_warning(path: Path) -> None:
    assert read_build_cfg(path).warnings == ()


@pytest.mark.parametrize(
    ("general", "profile"),
    [
        ("TargetBoard = miniitx,zynq7100", "miniitx-zynq7100"),
        ("TargetPart = XC7Z100ffg900-2", "miniitx-zynq7100"),
        ("TargetBoard = zcu104,revd", "zcu104"),
        ("TargetPart = xczu7ev-ffvc1156-2-e", "zcu104"),
        ("TargetBoard = zedboard,c\nTargetPart = xc7z020clg484-1", "native"),
        ("TargetPart = xc7z020clg484-1", "native"),
        ("TargetOS = linux", "native"),
    ],
)
def test_the_profile_of_a_board_and_a_warning_where_none_is_like_it(
    tmp_path: Path, general: str, profile: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "build.cfg"
    path.write_text(f"[General]\nName = x\n{general}\n", encoding="utf-8")
    assert target_profile(read_build_cfg(path)) == profile
    unlike = profile == "native" and general != "TargetOS = linux"
    assert ("there is no profile for the board" in caplog.text) == unlike


@pytest.mark.parametrize(
    ("general", "profile"),
    [("TargetBoard = zcu104,d", "zcu104"), ("TargetPart = xc7z100", "miniitx-zynq7100"), ("", "native")],
)
def test_every_verb_takes_the_profile_of_the_same_board(blink: Path, general: str, profile: str) -> None:
    replace(blink / "build.cfg", "TargetOS", f"{general}\nTargetOS")
    replace(blink / "main.py", "count.hardware", "count.hardware, hardware_timing=rz.Cycles(1)")
    replace(blink / "main.py", "from", "import reconros_zenoh as rz\nfrom")
    invoke("build", blink)
    assert run(blink, "--seconds", 1, "--bitstreams", blink / "bitstreams")["profile"] == profile
    assert rz.VirtualProject(blink).status()["profile"] == profile


def test_a_bitstream_for_another_profile_says_what_to_build(blink: Path) -> None:
    invoke("build", blink, "--profile", "zcu104")
    with pytest.raises(BitstreamError, match=r"`reconros build`, with the same --profile\."):
        run(blink, "--bitstreams", blink / "bitstreams")


def test_a_callback_without_times_is_refused_with_the_line_that_registers_it(blink: Path) -> None:
    with pytest.raises(FileError, match=r"main\.py:8: .* has no times for callback 'count'"):
        run(blink, "--profile", "miniitx-zynq7100")


@pytest.mark.parametrize("name", ["Blink", "my-project", "2go", "a__b", "a_", "."])
def test_names_that_a_project_cannot_have(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match="cannot name a project"):
        invoke("new", f"{tmp_path}/{name}/" if name != "." else ".")


def test_what_a_project_prints_is_not_in_the_json(blink: Path) -> None:
    path = blink / "callbacks.py"
    text = path.read_text(encoding="utf-8").replace("self.count += 1", "self.count += 1; print('counted')")
    path.write_text("print('imported')\n" + text, encoding="utf-8")
    assert run(blink, "--seconds", 1.05)["callbacks"]["count"]["failed"] == 0
    output = invoke("run", blink, "--clock", "virtual", "--seconds", 0.25)
    assert output.startswith("imported\ncounted\ncounted\n")


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()  # not even root can make a folder below it
    with pytest.raises(UsageError, match="cannot be written"):
        invoke("new", tmp_path / "file" / "blink")


@pytest.mark.parametrize("name", ["", "a/b", "a*", "a b", "router"])
def test_names_that_a_board_cannot_have(blink: Path, name: str) -> None:
    with pytest.raises(UsageError, match="cannot name a board"):
        run(blink, "--name", name)


def test_a_folder_that_is_there_is_left_alone(blink: Path) -> None:
    (blink / "main.py").write_text("mine", encoding="utf-8")
    with pytest.raises(UsageError, match="is there already"):
        invoke("new", blink)
    assert (blink / "main.py").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("seconds", ["inf", "nan", "1e300", "-1"])
def test_a_time_that_cannot_be(seconds: str, blink: Path) -> None:
    done = CliRunner().invoke(application, ["run", str(blink), "--clock", "virtual", "--seconds", seconds])
    assert done.exit_code == 2
    assert "Invalid value for '--seconds'" in done.stderr


def test_two_projects_with_modules_of_the_same_names_stay_apart(tmp_path: Path) -> None:
    for name in ("one", "two"):
        invoke("new", tmp_path / name)
    path = tmp_path / "two" / "callbacks.py"
    path.write_text(path.read_text(encoding="utf-8").replace("+= 1", "+= undefined"), encoding="utf-8")
    assert run(tmp_path / "one", "--seconds", 1)["callbacks"]["count"]["failed"] == 0
    assert run(tmp_path / "two", "--seconds", 1.05)["callbacks"]["count"]["failed"] == 10
    assert run(tmp_path / "one", "--seconds", 1)["callbacks"]["count"]["failed"] == 0
