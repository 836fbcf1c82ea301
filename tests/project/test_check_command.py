"""`reconros check` on project files as they lie about: `wild/*.cfg`, and what it has to say of each."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import typer
from hypothesis import example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from reconros_zenoh.cli.check import check
from reconros_zenoh.errors import FileError
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.resources import slot_resources
from reconros_zenoh.project.template import new_project

if TYPE_CHECKING:
    from collections.abc import Callable

WILD = sorted((Path(__file__).parent / "wild").glob("*.cfg"))

application = typer.Typer()
application.command("check")(check)


def run(*arguments: object) -> str:
    """Return what the command prints; raise what it raises."""
    result = CliRunner().invoke(application, [str(argument) for argument in arguments])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def facts(path: Path) -> Any:
    return json.loads(run(path, "--json"))


@pytest.fixture(params=WILD, ids=[path.stem for path in WILD])
def wild(request: pytest.FixtureRequest) -> Path:
    path: Path = request.param
    return path


@pytest.fixture
def expected(wild: Path) -> Any:
    return json.loads(wild.with_suffix(".json").read_text(encoding="utf-8"))


def test_there_are_ten_wild_files() -> None:
    assert len(WILD) == 10


def test_the_facts_of_a_wild_file(wild: Path, expected: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(wild.parent)
    assert facts(Path(wild.name)) == expected


@pytest.mark.parametrize(
    "rewrite",
    [
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.replace("\n", "\r").encode(),
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.rstrip("\n").encode(),
        lambda text: text.replace("@", "(at)").encode(),
        lambda text: text.replace(" = ", " \t=\t ").encode(),
        lambda text: text.replace("\n", " \t\n").encode(),
        lambda text: text.replace(", ", " ,\t").encode(),
        lambda text: text.replace("true", "TRUE").replace("True", "true").encode(),
    ],
    ids=["CRLF", "CR", "BOM", "no last line end", "(at)", "tabs", "trailing blanks", "commas", "booleans"],
)
def test_the_same_in_another_form(
    wild: Path,
    expected: Any,
    rewrite: Callable[[str], bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "wild"  # what has no Name is named after its folder
    folder.mkdir()
    (folder / wild.name).write_bytes(rewrite(wild.read_text(encoding="utf-8")))
    monkeypatch.chdir(folder)
    assert facts(Path(wild.name)) == expected


def test_what_is_not_utf_8_is_read_as_windows_1252(tmp_path: Path) -> None:
    path = tmp_path / "build.cfg"
    path.write_bytes(b"[General]\n# gr\xfc\xdfe\nName = M\xfcller\x81\n")
    found = facts(path)
    assert found["name"] == "Müller\N{REPLACEMENT CHARACTER}"
    assert found["warnings"] == [f"{path}:2: this is not UTF-8; it is read as Windows-1252."]


@pytest.mark.parametrize("text", ["", "\n# nothing yet\n", "[Makefile]\nall = 1\n"])
def test_a_file_with_nothing_of_a_project_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "build.cfg"
    path.write_text(text)
    with pytest.raises(FileError, match=r"build\.cfg:1: this is no ReconROS project file.*reconros new"):
        run(path)


def test_the_keys_are_those_that_were_promised() -> None:
    found = facts(Path(__file__).parent / "wild" / "gateway.cfg")
    assert list(found) == [
        "name",
        "board",
        "part",
        "os",
        "partial_reconfiguration",
        "ros2_distribution",
        "clocks",
        "slots",
        "threads",
        "resources",
        "gateways",
        "warnings",
    ]
    assert {key: list(found[key][0]) for key in ("clocks", "slots", "threads", "resources", "gateways")} == {
        "clocks": ["name", "source", "hz"],
        "slots": ["id", "name", "clock", "reconfigurable", "lut", "dsp", "bram36", "bram18"],
        "threads": ["name", "slots", "hardware", "software", "resource_groups"],
        "resources": ["group", "name", "type", "args"],
        "gateways": ["name", "slots", "hw_topic", "sw_topic", "type"],
    }


def test_a_folder_is_read_with_its_interfaces(tmp_path: Path) -> None:
    assert facts(application_folder())["name"] == "roundtrip"
    (tmp_path / "build.cfg").write_text("[General]\nName = x\n", encoding="utf-8")
    interface = tmp_path / "msg" / "a_msgs" / "msg" / "T.msg"
    interface.parent.mkdir(parents=True)
    interface.write_text("uint33 x\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"T\.msg:1: 'uint33' is no type"):
        run(tmp_path)
    assert facts(tmp_path / "build.cfg")["name"] == "x"


def test_a_folder_is_read_with_the_mapping_that_run_would_take(tmp_path: Path) -> None:
    folder = tmp_path / "blink"
    new_project(folder)
    path = folder / "build.cfg"
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace('node, count_msg, "/count"', "node, blink_msgs/Count, /count, hw"), encoding="utf-8"
    )
    with pytest.raises(FileError, match=r"build\.cfg:22: The callback count is mapped to software"):
        run(folder)
    shutil.rmtree(folder / "mappings")
    assert facts(folder)["name"] == "blink"  # in hardware, as it is built for
    path.write_text(path.read_text(encoding="utf-8").replace("HwSource = hls\n", ""), encoding="utf-8")
    with pytest.raises(FileError, match=r"build\.cfg:22: The callback count is mapped to software"):
        run(folder)


def test_a_mistake_that_follows_from_a_warning_comes_behind_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "blink" / "build.cfg"
    new_project(path.parent)
    path.write_text(path.read_text(encoding="utf-8").replace("HwSource", "HwSorce"), encoding="utf-8")
    with pytest.raises(FileError, match="which its thread is not built for"):
        run(path.parent)
    assert "the unknown option HwSorce is left out." in caplog.text


def test_the_text_shows_everything(wild: Path, expected: Any) -> None:
    output = run(wild)
    for kind in ("clocks", "slots", "threads", "gateways"):
        assert all(entry["name"] in output for entry in expected[kind])
    for resource in expected["resources"]:
        if resource["type"] in {"rossub", "rospub", "rossrvs", "rossrvc", "rosactions", "rosactionc"}:
            assert resource["args"][2] in output
    assert output.count("warning: ") == len(expected["warnings"])


GOOD = (application_folder() / "build.cfg").read_bytes() + (
    b'[ROSGateway@g]\nSlot = slot(3)\nHWTopic = "/a"\nSWTopic = "/b"\nMsgType = sensor_msgs/Image\n'
    b'[ResourceGroup@w(0:1)]\nn_% = rosnode, "/n_%"\nd = rospub, n_%, std_msgs/UInt32, "/d", hw\n'
)
pieces = st.sampled_from(
    [
        b"\n",
        b" ",
        b"\t",
        b",",
        b"=",
        b":",
        b"(",
        b")",
        b"[",
        b"]",
        b'"',
        b"#",
        b"@",
        b"%",
        b"*",
        b"0",
        b"9" * 30,
    ]
) | st.binary(max_size=3)
edits = st.tuples(st.integers(0, len(GOOD)), st.integers(0, 40), pieces)


@settings(max_examples=300)
@given(st.lists(edits, min_size=1, max_size=8))
@example([(0, len(GOOD), b"")])
def test_a_damaged_file_reads_or_is_a_file_error(
    tmp_path_factory: pytest.TempPathFactory, damage: list[tuple[int, int, bytes]]
) -> None:
    content = GOOD
    for position, length, piece in damage:
        content = content[:position] + piece + content[position + length :]
    path = tmp_path_factory.getbasetemp() / "damaged.cfg"
    path.write_bytes(content)
    line: int | None = 1
    try:
        configuration = read_build_cfg(path)
        assert all(slot_resources(slot.regions).lut >= 0 for slot in configuration.slots)
    except FileError as error:
        line = error.line
    assert line is not None
    assert 1 <= line <= content.count(b"\n") + content.count(b"\r") + 1


def test_topics_that_cannot_be_mapped_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "build.cfg"
    path.write_text(
        "[ResourceGroup@g]\nnode = rosnode, /n\na = rossub, node, std_msgs/UInt32, /a, hw\n"
        "number = rosmsg, std_msgs, msg, UInt32\nb = rospub, node, number, /a\n",
        encoding="utf-8",
    )
    with pytest.raises(FileError, match=r"build\.cfg:5: /a is mapped to hardware \(line 3\)"):
        run(path)


def test_a_service_name_that_ros_2_does_not_allow_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "build.cfg"
    path.write_text(
        "[ResourceGroup@g]\nnode = rosnode, /n\nflip = rossrvmsg, std_srvs, srv, SetBool\n"
        'serve = rossrvs, node, flip, "to flip"\n',
        encoding="utf-8",
    )
    with pytest.raises(FileError, match=r"build\.cfg:4: The topic or service name 'to flip' contains ' '"):
        run(tmp_path)


@pytest.mark.parametrize(
    "end",
    [
        "word = rosmsg, std_msgs, msg, Uint33\nsub = rossub, node, word, /a",
        "flip = rossrvmsg, std_srvs, srv, SetBol\nask = rossrvc, node, flip, /a",
        "go = rosactionmsg, std_srvs, action, SetBool\ndo = rosactions, node, go, /a",
        "[ROSGateway@g]\nSlot = s(*)\nHWTopic = /a\nSWTopic = /a\nMsgType = a_msgs/T",
    ],
)
def test_a_type_that_nobody_defines_is_refused(tmp_path: Path, end: str) -> None:
    path = tmp_path / "build.cfg"
    path.write_text(f"[ResourceGroup@g]\nnode = rosnode, /n\n{end}\n", encoding="utf-8")
    assert facts(path)  # of the file alone nobody knows what is in msg/
    with pytest.raises(FileError, match=r"build\.cfg:[34]: .* is not known"):
        run(tmp_path)


def test_the_mapping_files_of_a_folder_are_read(tmp_path: Path) -> None:
    folder = shutil.copytree(application_folder(), tmp_path / "project")
    run(folder)
    mapping = folder / "mappings" / "mixed.toml"
    mapping.write_text(mapping.read_text(encoding="utf-8") + "bogus = 3\n", encoding="utf-8")
    with pytest.raises(FileError, match=r"mixed\.toml:\d+: .*bogus: unknown key"):
        run(folder)
