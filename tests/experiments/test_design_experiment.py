"""The design example in virtual time: what the shared slot costs, and that both chains really work."""

from __future__ import annotations

import base64
import json
import re
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from host_clients.camera import CameraOptions
from host_clients.gallery import Gallery
from reconros_zenoh.applications.design_example.control.plant import SETPOINT
from reconros_zenoh.applications.design_example.picture import moving_picture
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics
from reconros_zenoh.applications.roundtrip.kernels.sobel import sobel
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.status import status
from reconros_zenoh.cli.design import design
from reconros_zenoh.errors import TransportError, UsageError
from reconros_zenoh.experiments import design_virtual
from reconros_zenoh.experiments.design import projects_folder
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from reconros_zenoh.measure.record import RoundTrip

SECONDS = 8
PROFILE = "miniitx-zynq7100"
application = typer.Typer()
application.command("design")(design)


def run(folder: Path, *arguments: object, status: int = 0) -> dict[str, Any]:
    """Return the object that the command prints."""
    words = ["--clock", "virtual", "--seconds", SECONDS, "--out", folder, "--json", *arguments]
    result = CliRunner().invoke(application, [str(word) for word in words])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == status, result.output
    experiment: dict[str, Any] = json.loads(result.stdout)
    return experiment


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("design")


@pytest.fixture(scope="module")
def experiment(folder: Path) -> dict[str, Any]:
    return run(folder)


def test_one_slot_is_reconfigured_at_every_alternation_and_two_slots_once_each(
    experiment: dict[str, Any],
) -> None:
    one, two = experiment["variants"]["one_slot"], experiment["variants"]["two_slots"]
    # A servo index is asked for every 100 ms, a picture comes every 200 ms: there and back for each picture.
    pictures = one["callbacks"]["filter"]["calls"]
    assert 2 * pictures - 2 <= one["reconfigurations"] <= 2 * pictures + 1
    assert pictures > 10
    assert [slot["reconfigurations"] for slot in two["slots"]] == [1, 1]
    assert {slot["holds"] for slot in two["slots"]} == {"filter", "inv_kinematics"}


def test_the_time_in_reconfigurations_is_that_of_table_2(experiment: dict[str, Any]) -> None:
    for variant in experiment["variants"].values():
        assert variant["reconfiguration_ms"] / variant["reconfigurations"] == pytest.approx(24.0, rel=0.03)
        assert variant["reconfiguration_ms"] == sum(slot["reconfiguration_ms"] for slot in variant["slots"])


def test_the_shared_slot_makes_both_chains_slower_by_what_it_says(experiment: dict[str, Any]) -> None:
    one, two = experiment["variants"]["one_slot"], experiment["variants"]["two_slots"]
    for chain, cost in experiment["shared_slot_costs_ms"].items():
        assert cost == one[f"{chain}_ms"]["median"] - two[f"{chain}_ms"]["median"]
    # A picture finds the slot with the other bitstream, always.
    assert experiment["shared_slot_costs_ms"]["filter"] > 24.0
    assert one["spans_ms"]["filter"]["reconfiguration"] > 20 > two["spans_ms"]["filter"]["reconfiguration"]


def test_all_that_comes_is_right_and_pictures_are_counted(experiment: dict[str, Any]) -> None:
    for variant in experiment["variants"].values():
        assert variant["wrong"] == 0
        assert variant["frames_in"] == SECONDS * 5
        assert 0 < variant["frames_out"] <= variant["callbacks"]["filter"]["calls"]
        assert variant["control_out"] > SECONDS * 10 - 5


def test_the_filtered_picture_is_the_kernels(folder: Path, experiment: dict[str, Any]) -> None:
    for variant in experiment["variants"]:
        made = folder / "virtual" / variant
        lines = (made / "filter.csv").read_text(encoding="utf-8").splitlines()
        for name, line in (
            ("first", next(line for line in lines[1:] if line.endswith("ok"))),
            ("last", lines[-1]),
        ):
            expected = sobel(moving_picture(int(line.split(",")[0])))
            assert np.array_equal(cv2.imread(str(made / f"{name}.png")), expected)
        with Image.open(made / "filtered.gif") as animation:
            assert animation.n_frames == experiment["variants"][variant]["frames_out"]


def test_the_report_is_one_file_with_the_pictures_in_it(folder: Path, experiment: dict[str, Any]) -> None:
    page = (folder / "virtual" / "report.html").read_text(encoding="utf-8")
    shown = [base64.b64decode(data) for data in re.findall(r"data:image/png;base64,([^\"]+)", page)]
    assert len(shown) == 8
    last = (folder / "virtual" / "two_slots" / "last.png").read_bytes()
    assert shown[-1] == last
    assert str(experiment["variants"]["one_slot"]["reconfigurations"]) in page
    assert page.count("<svg") == 1
    slower = r"a picture takes [\d.]+ ms longer \(.*\), a servo index [\d.]+ ms longer"
    assert re.search(slower, page)
    assert "http" not in re.sub(r"base64,[^\"]+", "", page)


def test_the_same_seed_gives_the_same_records_and_another_one_others(
    folder: Path, experiment: dict[str, Any], tmp_path: Path
) -> None:
    again, other = run(tmp_path / "again"), run(tmp_path / "other", "--seed", 1)
    assert again["variants"] == experiment["variants"] != other["variants"]
    for name in ("one_slot/filter.csv", "two_slots/control.csv"):
        first, second = (path / "virtual" / name for path in (folder, tmp_path / "again"))
        assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--view"], "needs --clock wall"),
        (["--profile", "native"], "models nothing"),
        (["--out", "/dev/null/design"], "cannot be written"),
    ],
)
def test_what_cannot_be_run_is_refused(tmp_path: Path, arguments: list[str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        run(tmp_path, *arguments)


def test_an_endless_run_is_refused(tmp_path: Path) -> None:
    result = CliRunner().invoke(application, ["--seconds", "inf", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "--seconds" in result.output


class Interrupted(Gallery):
    """Ends the run at the third picture of a variant."""

    endings: Iterator[bool]
    """Whether to do so, for each variant."""

    def __init__(self) -> None:
        super().__init__()
        self._left = 3 if next(self.endings) else -1

    def add(self, picture: NDArray[np.uint8]) -> None:
        super().add(picture)
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt


@pytest.mark.parametrize("variants", [["one_slot"], ["one_slot", "two_slots"]])
def test_what_was_measured_before_an_interruption_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, experiment: dict[str, Any], variants: list[str]
) -> None:
    monkeypatch.setattr(design_virtual, "Gallery", Interrupted)
    Interrupted.endings = iter(name == variants[-1] for name in variants)
    kept = run(tmp_path, status=130)
    assert kept["interrupted"] is True
    assert list(kept["variants"]) == variants
    last = kept["variants"][variants[-1]]
    assert last["frames_out"] == 3
    assert 3 <= last["frames_in"] < experiment["variants"][variants[-1]]["frames_in"]
    assert kept["shared_slot_costs_ms"].keys() == {"filter", "control"}
    assert [cost is None for cost in kept["shared_slot_costs_ms"].values()] == [len(variants) == 1] * 2
    assert json.loads((tmp_path / "virtual" / "experiment.json").read_text(encoding="utf-8")) == kept
    with Image.open(tmp_path / "virtual" / variants[-1] / "filtered.gif") as animation:
        assert animation.n_frames == 3
    page = (tmp_path / "virtual" / "report.html").read_text(encoding="utf-8")
    assert "The run was interrupted" in page
    assert page.count("data:image/png") == 4 * len(variants)


def test_an_interruption_before_anything_leaves_no_report_of_an_earlier_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    (tmp_path / "virtual").mkdir()
    (tmp_path / "virtual" / "report.html").touch()
    monkeypatch.setattr(Simulation, "run", interrupted)
    assert run(tmp_path, status=130)["variants"] == {}
    assert not (tmp_path / "virtual" / "report.html").exists()


class Example:
    """Vision and control on a network, with what is published on the control topics."""

    def __init__(self, simulation: Simulation, mapping: str) -> None:
        profile = read_profile(PROFILE)
        vision, control = (load_project(projects_folder() / name) for name in ("vision", "control"))
        self.hosted = simulation.add_board(profile, vision, vision.mapping(mapping), BoardOptions("vision"))
        simulation.add_board(profile, control, control.mapping("software"), BoardOptions("control"))
        node = simulation.context().node("listener")
        self.heard: dict[str, list[int]] = {"/ctrl_out": [], "/tf_out": [], "/position": []}
        for topic, values in self.heard.items():
            kind = "Int32" if topic == "/position" else "UInt32"
            node.subscription(
                vision.types().message(f"std_msgs/msg/{kind}"),
                topic,
                lambda received, values=values: values.append(received.message.data),
            )


def test_the_control_loop_closes_over_both_boards() -> None:
    with Simulation(load_project(projects_folder() / "vision").types()) as simulation:
        example = Example(simulation, "two_slots")
        simulation.environment.run(until=3_500_000_000)
    heard = example.heard
    # The servo follows the controller: each index is the answer to its command, in order.
    expected = [inverse_kinematics(word) for word in heard["/ctrl_out"]]
    assert heard["/tf_out"] == expected[: len(heard["/tf_out"])]
    assert len(heard["/tf_out"]) >= len(expected) - 1 > 20
    # The platform, which only the servo moves, leans from 0 to the setpoint and then to the other side.
    tilts = [word / 256 for word in heard["/position"]]
    assert abs(tilts[0]) < 0.1
    assert tilts[29] == pytest.approx(SETPOINT, abs=0.2)
    assert tilts[-1] < 0


def test_without_the_board_in_between_the_platform_stays_where_it_is() -> None:
    control = load_project(projects_folder() / "control")
    positions: list[int] = []
    with Simulation(control.types()) as simulation:
        simulation.add_board(
            read_profile(PROFILE), control, control.mapping("software"), BoardOptions("control")
        )
        simulation.context().node("listener").subscription(
            control.types().message("std_msgs/msg/Int32"),
            "/position",
            lambda received: positions.append(received.message.data),
        )
        simulation.environment.run(until=2_000_000_000)
    assert len(positions) > 15
    assert len(set(positions)) == 1


def test_the_scope_and_the_viewer_tell_lost_and_wrong_from_right() -> None:
    trips: dict[str, list[RoundTrip]] = {"picture": [], "control": []}
    shown: list[NDArray[np.uint8]] = []
    types = load_project(projects_folder() / "vision").types()
    word = types.message("std_msgs/msg/UInt32")
    with Simulation(types) as simulation:
        simulation.add_viewer(0, trips["picture"].append, trips["control"].append, shown.append)
        node = simulation.context().node("liar")
        commands, indices = (node.publisher(word, topic) for topic in ("/ctrl_out", "/tf_out"))

        def publish(at_ms: int, publisher: Any, value: int) -> None:
            simulation.environment.call_later(at_ms * 1_000_000, publisher.publish, word.cls(data=value))

        first, second = 5 << 17, 900 << 17
        publish(1, commands, first)
        publish(2, commands, second)
        publish(4, indices, inverse_kinematics(second))  # that of the first never comes
        publish(5, indices, 12345)
        publish(6, commands, 0x7)  # a leg that there is not
        publish(1200, indices, 54321)
        simulation.environment.run(until=2_000_000_000)
    assert [(trip.index, trip.time_ns, trip.outcome) for trip in trips["control"]] == [
        (0, None, "lost"),
        (1, 2_000_000, "ok"),
        (2, 0, "wrong"),
    ]
    assert (trips["picture"], shown) == ([], [])


def test_a_camera_that_nobody_looks_at_says_so() -> None:
    types = load_project(projects_folder() / "vision").types()
    with Simulation(types) as simulation:
        camera = simulation.add_camera(CameraOptions(5, wait_s=3))
        with pytest.raises(TransportError, match="nobody in domain 0 subscribed to /image_raw within 3 s"):
            simulation.run()
    assert camera.sent == 0


def test_a_camera_waits_for_the_others_of_its_group() -> None:
    types = load_project(projects_folder() / "vision").types()
    began_ns: list[int] = []
    with Simulation(types) as simulation:
        simulation.context().node("listener").subscription(
            types.message("sensor_msgs/msg/Image"),
            "/image_raw",
            lambda _: began_ns.append(simulation.environment.now),
        )
        simulation.add_camera(CameraOptions(1, group="g", members=2))
        simulation.environment.call_later(
            1_000_000_000, lambda: simulation.add_viewer(0, [].append, [].append, group="g")
        )
        simulation.run()
    assert began_ns == [1_000_000_000]


def test_the_board_goes_on_after_pictures_that_it_cannot_filter() -> None:
    with Simulation(load_project(projects_folder() / "vision").types()) as simulation:
        example = Example(simulation, "one_slot")
        types = load_project(projects_folder() / "vision").types()
        image = types.message("sensor_msgs/msg/Image")
        header = types.message("std_msgs/msg/Header").cls(
            stamp=types.message("builtin_interfaces/msg/Time").cls(sec=0, nanosec=0), frame_id="0"
        )
        small = image.cls(
            header=header,
            height=1,
            width=1,
            encoding="bgr8",
            is_bigendian=0,
            step=3,
            data=np.zeros(3, "u1"),
        )
        publisher = simulation.context().node("stranger").publisher(image, "/image_raw")
        simulation.environment.call_later(500_000_000, publisher.publish, small)
        simulation.environment.run(until=1_500_000_000)
        told = status(example.hosted.board, example.hosted.executor)
    assert told["rejected"] == {"image_size": 1}
    assert told["callbacks"]["inv_kinematics"]["calls"] > 10
