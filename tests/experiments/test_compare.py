"""`reconros compare`: one project under several mappings."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
import typer
from rosbags.rosbag2 import Writer
from typer.testing import CliRunner

from reconros_zenoh.cli.compare import compare
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.measure.record import read_record
from reconros_zenoh.project.template import new_project
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.ros.zero_message import message_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

MAPPINGS = ["all_hardware", "all_software", "mixed"]
WORD = "std_msgs/msg/UInt32"

application = typer.Typer()
application.command("compare")(compare)
types = TypeRegistry()


def run(project: Path, out: Path, *arguments: object) -> str:
    """Return what the command prints; raise what it raises."""
    given = [str(project), "--out", str(out), *map(str, arguments)]
    result = CliRunner().invoke(application, given, env={"COLUMNS": "80"})
    if result.exception:
        raise result.exception
    return result.stdout


def round_trips(out: Path, *arguments: object) -> dict[str, Any]:
    """Return the object of a comparison of the shipped project."""
    experiment: dict[str, Any] = json.loads(run(application_folder(), out, "--json", *arguments))
    return experiment


def write_bag(
    path: Path, messages: Sequence[tuple[str, str, int | None, dict[str, Any]]], digest: str = ""
) -> Path:
    """Write a recording of messages: topic, type, time [ms], None for a topic without any, and fields."""
    with Writer(path, version=9) as bag:
        connections: dict[str, Any] = {}
        for topic, name, at_ms, fields in messages:
            kind = types.message(name)
            if topic not in connections:
                connections[topic] = bag.add_connection(
                    topic, name, msgdef="uint32 data", rihs01=digest or kind.type_hash
                )
            if at_ms is not None:
                payload = b"".join(kind.encode(message_of(kind, fields)))
                bag.write(connections[topic], 10**18 + at_ms * 10**6, payload)
    return path


def test_all_mappings_have_the_same_to_do(tmp_path: Path) -> None:
    told = round_trips(tmp_path / "out", "--input", "/angle={data: 80}", "--rate", 100, "--seconds", 0.5)
    assert list(told["mappings"]) == MAPPINGS
    assert told["inputs"] == {"/angle": WORD}
    assert told["silent"] == ["/image_classification", "/image_raw"]
    assert (told["seconds"], told["rate_hz"], told["bag"], told["interrupted"]) == (0.5, 100, None, False)
    for measured in told["mappings"].values():
        output = measured["outputs"]["/legangle"]
        assert output["sent"] + measured["dropped"] == pytest.approx(50, abs=3)  # the last are on their way
        assert output["rate_hz"] == output["sent"] / 0.5
        assert 0 < output["median_ms"] <= output["p95_ms"] <= output["p99_ms"] <= output["max_ms"]
        assert measured["outputs"]["/filtered"]["sent"] == 0
        assert measured["outputs"]["/filtered"]["median_ms"] is None
        assert measured["failed"] == measured["refused"] == 0
        assert 0 < measured["busiest"]["share"] < 1
    assert told == json.loads((tmp_path / "out" / "experiment.json").read_text())


def test_the_records_hold_every_age_and_the_same_seed_gives_the_same(tmp_path: Path) -> None:
    for name in "ab":
        told = round_trips(
            tmp_path / name, "--input", "/angle", "--seconds", 0.5, "--mapping", "mixed", "--seed", 3
        )
    assert list(told["mappings"]) == ["mixed"]
    record = read_record(tmp_path / "a" / "mixed" / "legangle.csv")
    assert record.values_ms.size == told["mappings"]["mixed"]["outputs"]["/legangle"]["sent"]
    for drawing in ("compare.png", "mixed/trace.png"):
        assert (tmp_path / "a" / drawing).read_bytes().startswith(b"\x89PNG")
    for file in (tmp_path / "a").rglob("*.csv"):
        assert file.read_bytes() == (tmp_path / "b" / file.relative_to(tmp_path / "a")).read_bytes()


def test_inputs_do_not_come_all_at_once(tmp_path: Path) -> None:
    """With a period of 100 ms and two inputs, the first comes after 50 ms, the second after 100."""
    image = "/image_raw={height: 1, width: 1, encoding: bgr8, step: 3, data: [1, 2, 3]}"
    told = round_trips(
        tmp_path, "--input", "/angle", "--input", image, "--seconds", 0.09, "--mapping", "mixed"
    )
    assert told["mappings"]["mixed"]["outputs"]["/legangle"]["sent"] == 1
    assert told["mappings"]["mixed"]["refused"] == 0
    told = round_trips(
        tmp_path, "--input", "/angle", "--input", image, "--seconds", 0.16, "--mapping", "mixed"
    )
    assert told["mappings"]["mixed"]["refused"] == 1  # the Sobel callback takes 640 x 480


def test_a_recording_is_played_at_its_own_times(tmp_path: Path) -> None:
    bag = write_bag(
        tmp_path / "bag",
        [("/angle", WORD, at_ms, {"data": 80}) for at_ms in (0, 40, 200)] + [("/other", WORD, 900, {})],
    )
    told = round_trips(tmp_path / "out", "--bag", bag, "--mapping", "all_hardware")
    assert told["seconds"] == pytest.approx(0.9)
    assert told["mappings"]["all_hardware"]["outputs"]["/legangle"]["sent"] == 3
    told = round_trips(tmp_path / "out", "--bag", bag, "--mapping", "all_hardware", "--seconds", 0.1)
    assert told["mappings"]["all_hardware"]["outputs"]["/legangle"]["sent"] == 2


def test_an_input_goes_before_the_recording_of_its_topic(tmp_path: Path) -> None:
    messages = [("/angle", WORD, at_ms, {"data": 80}) for at_ms in (0, 500)]
    bag = write_bag(tmp_path / "bag", [*messages, ("/other", WORD, 100, {})])
    given = ("--input", "/angle", "--rate", 20, "--mapping", "mixed", "--seconds", 0.5)
    alone, beside = (round_trips(tmp_path / "out", *given, *more) for more in ((), ("--bag", bag)))
    assert alone["mappings"] == beside["mappings"]
    assert beside["mappings"]["mixed"]["outputs"]["/legangle"]["sent"] == 9


def test_a_project_that_drives_itself_needs_no_input(tmp_path: Path) -> None:
    new_project(tmp_path / "blink")
    main = tmp_path / "blink" / "main.py"
    main.write_text(
        "from reconros_zenoh import Cycles\n"
        + main.read_text().replace(
            "hardware=count.hardware",
            "hardware=count.hardware, hardware_timing=Cycles(1000), software_timing=Cycles(1000)",
        )
    )
    shown = run(tmp_path / "blink", tmp_path / "out", "--profile", "zcu104", "--seconds", 1.05)
    assert "nobody published" not in shown
    rows = [line.split()[:3] for line in shown.splitlines() if line.startswith("/count")]
    assert rows == [["/count", "hardware", "9.524"], ["/count", "software", "9.524"]]


def test_what_a_publisher_pushes_out_is_lost(tmp_path: Path) -> None:
    project = tmp_path / "blink"
    new_project(project)
    (project / "msg" / "blink_msgs" / "msg" / "Count.msg").write_text("uint8[1000000] count\n")
    (project / "main.py").write_text(
        "import numpy as np\n"
        "from reconros_zenoh import Cycles\n"
        "def main(app):\n"
        "    pub = app.writer('count', 'pub')\n"
        "    def software(message, context):\n"
        "        context.publish(pub, pub.message(count=np.zeros(1_000_000, np.uint8)))\n"
        "    app.register('count', 'timer', software=software, software_timing=Cycles(1000))\n"
        "    app.spin()\n"
    )
    given = ("--profile", "miniitx-zynq7100", "--mapping", "software", "--seconds", 1.95)
    faster = (project / "build.cfg").read_text().replace("rostmr, node, 100", "rostmr, node, 10")
    (project / "build.cfg").write_text(faster)
    told = json.loads(run(project, tmp_path / "out", "--json", *given))["mappings"]["software"]
    calls = told["status"]["callbacks"]["count"]["calls"]
    assert told["dropped"] > 100
    assert told["outputs"]["/count"]["sent"] + told["dropped"] == pytest.approx(calls, abs=12)  # on their way


def test_what_a_gateway_pushes_out_is_lost(tmp_path: Path) -> None:
    project = tmp_path / "watcher"
    new_project(project)
    (project / "build.cfg").write_text(
        (project / "build.cfg")
        .read_text()
        .replace("slot(0:0)", "slot(0:1)")
        .replace("Region_0 =", "Region_1 = SLICE_X50Y0:SLICE_X99Y49\nRegion_0 =")
        .replace("timer = rostmr, node, 100", 'sub = rossub, node, std_msgs/UInt32, "/word", hw, 1, block')
        + "[ROSGateway@bridge]\nSlot = slot(1)\nHWTopic = /word\nSWTopic = /word\n"
        "MsgType = std_msgs/UInt32\nDepth = 1\n"
    )
    (project / "main.py").write_text(
        "from reconros_zenoh import Cycles\n"
        "def main(app):\n"
        "    def hardware(thread):\n"
        "        yield from thread.compute(lambda: None)\n"
        "    app.register('count', 'sub', hardware=hardware, hardware_timing=Cycles(50_000_000))\n"
        "    app.spin()\n"
    )
    given = ("--profile", "zcu104", "--mapping", "hardware", "--input", "/word", "--seconds", 1.95)
    told = json.loads(run(project, tmp_path / "out", "--json", *given))["mappings"]["hardware"]
    assert told["dropped"] > 10
    (gateway,) = told["status"]["gateways"]
    assert gateway["to_hmt"] + told["dropped"] == pytest.approx(19, abs=2)  # two are on their way


def test_where_nothing_leaves_the_board_nothing_is_drawn(tmp_path: Path) -> None:
    (tmp_path / "compare.png").write_text("of an earlier run")
    shown = run(application_folder(), tmp_path, "--seconds", 0.1, "--mapping", "mixed")
    assert "nobody published on /angle, /image_classification, /image_raw: --input TOPIC" in shown
    assert "drawn" not in shown
    assert "publishes" not in shown
    assert not (tmp_path / "compare.png").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--input", "/angel"], "the project does not wait for '/angel' from outside. It does for: /angle"),
        (["--input", "/legangle"], "; what it publishes itself is not from outside."),
        (
            ["--input", "/angle", "--input", "/angle={data: 80}"],
            "/angle has two inputs. Give all",
        ),
        (["--input", "/angle={data: "], "is no YAML after the `=`"),
        (["--input", "/angle=80"], "write the fields as of `ros2 topic pub`"),
        (["--input", "/angle={date: 80}"], "has no field 'date'"),
        (["--bag", "nowhere"], "nowhere cannot be read as a rosbag2 recording"),
        (["--mapping", "mixt"], "no mapping named 'mixt'"),
        (["--mapping", "mixed", "--mapping", "mixed"], "two mappings are named 'mixed'. Give it once"),
        (["--profile", "native"], "profile 'native' models nothing"),
    ],
)
def test_what_cannot_be_used_is_told(tmp_path: Path, arguments: list[str], says: str) -> None:
    with pytest.raises(UsageError) as caught:
        round_trips(tmp_path, *arguments)
    assert says in str(caught.value)


def test_a_recording_of_one_message_needs_seconds(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", [("/angle", WORD, 0, {"data": 80})])
    with pytest.raises(UsageError, match=r"bag is over at once. Say with --seconds"):
        round_trips(tmp_path / "out", "--bag", bag)
    told = round_trips(tmp_path / "out", "--bag", bag, "--mapping", "mixed", "--seconds", 0.1)
    assert told["mappings"]["mixed"]["outputs"]["/legangle"]["sent"] == 1


def test_a_recorded_topic_without_messages_is_silent(tmp_path: Path) -> None:
    empty = ("/image_raw", "sensor_msgs/msg/Image", None, {})
    bag = write_bag(tmp_path / "empty", [empty])
    with pytest.raises(UsageError, match=r"has no message that the project waits for. It has: none"):
        round_trips(tmp_path / "out", "--bag", bag)
    bag = write_bag(tmp_path / "heard", [empty, ("/angle", WORD, 0, {})])
    told = round_trips(tmp_path / "out", "--bag", bag, "--mapping", "mixed", "--seconds", 0.01)
    assert told["silent"] == ["/image_classification", "/image_raw"]


def test_recordings_of_other_topics_or_types_are_refused(tmp_path: Path) -> None:
    other = write_bag(tmp_path / "other", [("/else", WORD, 0, {})])
    with pytest.raises(UsageError, match=r"has no message that the project waits for. It has: /else"):
        round_trips(tmp_path / "out", "--bag", other)
    wrong = write_bag(tmp_path / "wrong", [("/angle", "std_msgs/msg/Int32", 0, {})])
    with pytest.raises(UsageError, match="was recorded as std_msgs/msg/Int32"):
        round_trips(tmp_path / "out", "--bag", wrong)
    changed = write_bag(tmp_path / "changed", [("/angle", WORD, 0, {})], "RIHS01_" + "0" * 64)
    with pytest.raises(UsageError, match="with another definition"):
        round_trips(tmp_path / "out", "--bag", changed)


def test_a_folder_that_is_no_project(tmp_path: Path) -> None:
    with pytest.raises(FileError):
        run(tmp_path, tmp_path / "out")
