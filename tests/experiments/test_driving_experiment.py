"""Section 6 of the gateways paper in virtual time: the chain of nodes, and that the robot drives by it."""

from __future__ import annotations

import csv
import json
import math
from contextlib import contextmanager
from functools import cache
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from typer.testing import CliRunner

from host_clients.robot import RobotOptions, Step, stood_s
from reconros_zenoh.applications.driving.nodes import check_picture
from reconros_zenoh.applications.driving.world import RED_S, Robot, World
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.experiment import app
from reconros_zenoh.errors import BadMessageError, ExperimentError, TransportError, UsageError
from reconros_zenoh.experiments import driving
from reconros_zenoh.experiments.driving import (
    SECTIONS,
    VARIANTS,
    Drive,
    anchors,
    check_profile,
    run_variant,
    summary,
    troubles,
    write_records,
)
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.mapping.communication import Crossings, map_topics
from reconros_zenoh.mapping.project_graph import read_project_graph
from reconros_zenoh.measure.driving_plots import driving_figure
from reconros_zenoh.measure.record import find_records, read_record, short_names
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project, read_project
from reconros_zenoh.ros.image import image_message
from reconros_zenoh.ros.type_registry import TypeRegistry

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from reconros_zenoh.project.hosting import HostedBoard

PICTURES = 70
PROFILE = read_profile("zcu104")
IMAGE_BYTES = 640 * 480 * 3
PIXEL_PER_CYCLE_MS = 640 * 480 / 100_000


@contextmanager
def board() -> Iterator[tuple[Simulation, HostedBoard, TypeRegistry]]:
    """Begin a simulation with the example as it ships, every topic in memory."""
    with as_file(files("reconros_zenoh.applications.driving")) as folder:
        project = load_project(folder)
    with Simulation(project.types()) as simulation:
        hosted = simulation.add_board(PROFILE, project, project.mapping(None), BoardOptions())
        yield simulation, hosted, project.types()


@cache
def drive(variant: str) -> Drive:
    return run_variant(PROFILE, variant, PICTURES)


@cache
def experiment() -> dict[str, Any]:
    return summary(PROFILE, PICTURES, {name: drive(name) for name in VARIANTS}, interrupted=False)


def test_the_chain_takes_what_the_paper_measured_within_a_tenth() -> None:
    assert len(experiment()["anchors"]) == 3
    for anchor in experiment()["anchors"]:
        assert abs(anchor["error"]) < 0.1, anchor
        assert anchor["error"] == pytest.approx(anchor["ours"] / anchor["paper"] - 1)
    assert troubles(experiment()) == []


def test_a_gateway_saves_three_transfers_of_a_picture() -> None:
    """In memory the picture is written once and read by three slots, which share the MEMIF."""
    sections = [experiment()["variants"][name]["sections_ms"] for name in ("hardware_topics", "gateways")]
    first, *others = SECTIONS
    transfer_ms = IMAGE_BYTES / 346e3
    assert sections[0][first] - sections[1][first] == pytest.approx(3 * transfer_ms, rel=0.01)
    for section in others:
        assert sections[0][section] == pytest.approx(sections[1][section])
    assert sections[1][first] == pytest.approx(PIXEL_PER_CYCLE_MS + transfer_ms + 0.2113, rel=0.01)


def test_sections_add_up_to_the_chain_and_lie_in_the_loop() -> None:
    for name in VARIANTS:
        measured = drive(name)
        for number, chain_ms in zip(measured.sections_ms, measured.chain_ms, strict=True):
            assert chain_ms < measured.loop_ms[number]
        variant = experiment()["variants"][name]
        assert sum(variant["sections_ms"].values()) == pytest.approx(variant["chain_mean_ms"])


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_robot_stands_while_the_light_is_red_and_keeps_its_lane(variant: str) -> None:
    steps = drive(variant).steps
    standing = [step.seconds for step in steps[5:] if not step.speed]
    assert standing == [step.seconds for step in steps if standing[0] <= step.seconds <= standing[-1]]
    assert 1 < standing[0] < 2  # as soon as it sees the light
    assert RED_S <= standing[-1] < RED_S + 0.3
    assert steps[-1].speed > 0
    assert max(abs(step.off_lane) for step in steps) < 0.02


def test_the_map_finds_in_each_picture_what_was_in_the_one_before() -> None:
    matches: list[int] = []
    with board() as (simulation, _, types):
        simulation.context().node("desktop").subscription(
            types.message("std_msgs/msg/UInt32"),
            "/matches",
            lambda received: matches.append(received.message.data),
        )
        simulation.add_robot(RobotOptions(5), lambda _: None)
        simulation.run()
    first, *others = matches
    assert first == 0
    assert len(others) == 4
    assert all(count > 200 for count in others)


def test_the_method_finds_the_gateway_of_the_paper() -> None:
    with as_file(files("reconros_zenoh.applications.driving")) as folder:
        project = read_project(folder)
    graph = read_project_graph(project.configuration, project.mapping(None))
    mappings = {topic: decision.mapping for topic, decision in map_topics(graph).items()}
    assert [topic for topic, mapping in mappings.items() if mapping == "gateway"] == ["/image"]
    assert [topic for topic, mapping in mappings.items() if mapping == "hardware"] == [
        "/blurred",
        "/birds_view",
    ]
    crossings = Crossings.of(graph, mappings)
    assert [
        len(edges) for edges in (crossings.all_software, crossings.hardware_topics, crossings.gateways)
    ] == [12, 8, 5]


def test_the_same_drive_comes_out_again() -> None:
    assert run_variant(PROFILE, "gateways", PICTURES) == drive("gateways")


@pytest.mark.parametrize(
    ("key", "value", "trouble"),
    [
        ("answered", PICTURES - 4, "gateways: 3 of 69 pictures had no command."),
        ("unexpected", 2, "gateways: 2 commands came for no picture."),
        ("most_off_lane_mm", 201.0, "gateways: the robot left its lane."),
        ("stood_at_red_s", 0.0, "gateways: the robot did not stop at the red light."),
        ("stood_else_s", 0.6, "gateways: the robot stood for 0.6 s without a red light."),
    ],
)
def test_what_goes_wrong_in_a_drive_is_told_and_the_status_is_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, value: float, trouble: str
) -> None:
    def changed(*arguments: Any, **options: Any) -> dict[str, Any]:
        result = summary(*arguments, **options)
        result["variants"]["gateways"][key] = value
        return result

    monkeypatch.setattr(driving, "run_variant", lambda _, variant, __: drive(variant))
    monkeypatch.setattr(driving, "summary", changed)
    done = CliRunner().invoke(app, ["driving", "--pictures", str(PICTURES), "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert trouble in done.stdout.splitlines()


def made_up(off_lane: list[float], speeds: list[float], red: list[bool]) -> Drive:
    """Return a drive of three pictures that came through in 20, 30 and 70 ms, besides the first."""
    steps = [
        Step(number / 10, 0.0, 0.0, *step)
        for number, step in enumerate(zip(off_lane, speeds, red, strict=True))
    ]
    sections_ms = {1: [5.0, 5.0, 5.0, 5.0], 2: [10.0, 5.0, 10.0, 5.0], 3: [30.0, 20.0, 10.0, 10.0]}
    return Drive(steps, sections_ms, {1: 40.0, 2: 50.0, 3: 90.0}, 4)


def test_what_is_told_of_a_drive() -> None:
    measured = made_up([0.0, 0.01, -0.03, 0.02], [0.0, 0.5, 0.0, 0.0], [True, True, True, False])
    (variant,) = summary(PROFILE, 4, {"gateways": measured}, interrupted=False)["variants"].values()
    assert (variant["answered"], variant["unexpected"]) == (3, 4)
    assert variant["chain_mean_ms"] == 40
    assert variant["chain_sd_ms"] == pytest.approx(math.sqrt((20**2 + 10**2 + 30**2) / 3))
    assert variant["loop_median_ms"] == 50
    assert list(variant["sections_ms"].values()) == pytest.approx([15, 10, 25 / 3, 20 / 3])
    assert variant["most_off_lane_mm"] == pytest.approx(30)
    # That it stands until its first command is not heeding the light.
    assert (variant["stood_at_red_s"], variant["stood_else_s"]) == (0.1, 0.1)


def test_a_row_of_a_record_belongs_to_one_picture(tmp_path: Path) -> None:
    write_records(tmp_path, {"gateways": made_up([0.0] * 4, [0.0, 0.1, 0.2, 0.3], [True] * 4)})
    with (tmp_path / "gateways" / "pictures.tsv").open() as file:
        rows = list(csv.DictReader(file, dialect="excel-tab"))
    assert [row["picture"] for row in rows] == ["0", "1", "2", "3"]
    assert [row["speed"] for row in rows] == ["0.0", "0.1", "0.2", "0.3"]
    assert [row["loop_ms"] for row in rows] == ["", "40.0", "50.0", "90.0"]
    assert [row[SECTIONS[0]] for row in rows] == ["", "5.0", "10.0", "30.0"]


def test_its_times_are_records_with_the_same_names_under_each_variant(tmp_path: Path) -> None:
    measured = made_up([0.0] * 4, [0.0] * 4, [True] * 4)
    del measured.loop_ms[2]
    write_records(tmp_path, {"all_software": measured, "gateways": measured})
    paths = find_records(tmp_path)
    assert short_names(paths) == [
        "all_software/chain",
        "all_software/robot",
        "gateways/chain",
        "gateways/robot",
    ]
    chain, robot = (read_record(path) for path in paths[:2])
    assert (chain.values_ms.tolist(), chain.lost) == ([20.0, 30.0, 70.0], 0)
    assert (robot.values_ms.tolist(), robot.lost) == ([40.0, 90.0], 1)


def test_the_table_has_what_the_object_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(driving, "run_variant", lambda *_: made_up([0.0] * 4, [0.5] * 4, [True] * 4))
    done = CliRunner().invoke(app, ["driving", "--pictures", "20", "--out", str(tmp_path)])
    rows = {
        line.rsplit(maxsplit=3)[0].strip(): line.split()[-3:]
        for line in done.stdout.splitlines()[:12]
        if line
    }
    assert rows["whole chain"] == ["40.00"] * 3
    assert rows["its standard deviation"] == ["21.60"] * 3
    assert rows["the paper's chain"] == ["-", "28.26", "20.27"]
    assert rows["robot's picture to its command"] == ["50.00"] * 3


def test_the_drawing_marks_the_paper_and_shows_the_last_drive() -> None:
    steps = [(0.0, 0.0, True), (0.1, 0.4, False)]
    figure = driving_figure(experiment(), steps, {"seen": np.zeros((4, 4, 3), np.uint8)})
    chains, _, speed = figure.axes
    assert [line.get_xdata()[0] for line in chains.lines] == [28.264, 20.270]
    assert [bar.get_width() for bar in chains.patches[:4]] == pytest.approx(
        list(experiment()["variants"]["all_software"]["sections_ms"].values())
    )
    assert list(speed.lines[0].get_ydata()) == [0.0, 0.4]


def test_no_message_that_the_nodes_cannot_use_comes_to_them() -> None:
    """Neither a grey picture where a coloured one is wanted nor a lane without numbers; then it goes on."""
    with board() as (simulation, hosted, types):
        foreign = simulation.context().node("foreign")
        grey = image_message(types, "mono8", np.zeros((480, 640), np.uint8))
        coloured = image_message(types, "bgr8", np.zeros((480, 640, 3), np.uint8))
        lane = types.message("driving_msgs/msg/Lane")
        nowhere = lane.cls(header=grey.header, offset=float("nan"), slope=0.0, curvature=0.0, pixels=1)
        for topic, kind, message in (
            ("/image", "sensor_msgs/msg/Image", grey),
            ("/blurred", "sensor_msgs/msg/Image", grey),
            ("/birds_view", "sensor_msgs/msg/Image", coloured),
            ("/lane", "driving_msgs/msg/Lane", nowhere),
        ):
            publisher = foreign.publisher(types.message(kind), topic)
            simulation.environment.call_later(1_000_000, publisher.publish, message)
        robot = simulation.add_robot(RobotOptions(30), lambda _: None)
        simulation.run()
    statistics = hosted.executor.statistics()
    assert {name: one["failed"] for name, one in statistics.items()} == dict.fromkeys(statistics, 0)
    # Four read /image: blur, two detections and the map.
    assert hosted.board.context.rejections.counts() == {"image_encoding": 6, "lane": 1}
    assert robot.unanswered == 0
    assert stood_s(robot.steps, red=True) > 0


def test_a_node_that_nobody_observes_takes_pictures_of_others() -> None:
    """One whose name no other station had, as of a node that was replaced by one elsewhere."""
    heard: list[str] = []
    with board() as (simulation, hosted, types):
        foreign = simulation.context().node("foreign")
        picture = image_message(types, "bgr8", World().picture(Robot(), 0.0, 0))
        picture.header.frame_id = "foreign"
        publisher = foreign.publisher(types.message("sensor_msgs/msg/Image"), "/image")
        foreign.subscription(
            types.message("geometry_msgs/msg/TwistStamped"),
            "/drive",
            lambda received: heard.append(received.message.header.frame_id),
        )
        simulation.environment.call_later(1_000_000, publisher.publish, picture)
        simulation.environment.run(until=500_000_000)
    assert heard == ["foreign"]
    assert hosted.executor.failures.total() == 0


def test_each_detection_tells_once_and_watches_again_when_the_other_has_told() -> None:
    told: list[tuple[str, str]] = []
    seen = {"none": (Robot(), 0.0), "red": (Robot.after(1.2), 0.0), "green": (Robot.after(1.2), RED_S)}
    with board() as (simulation, _, types):
        foreign = simulation.context().node("foreign")
        publisher = foreign.publisher(types.message("sensor_msgs/msg/Image"), "/image")
        for colour in ("red", "green"):
            foreign.subscription(
                types.message("std_msgs/msg/Header"),
                f"/{colour}_light",
                lambda received, colour=colour: told.append((colour, received.message.frame_id)),
            )
        for number, what in enumerate(("none", "green", "red", "red", "green", "red", "none", "none")):
            picture = image_message(types, "bgr8", World().picture(*seen[what], number))
            picture.header.frame_id = f"{number} {what}"
            simulation.environment.call_later(1_000_000 + number * 200_000_000, publisher.publish, picture)
        simulation.environment.run(until=2_000_000_000)
    assert told == [("red", "2 red"), ("green", "4 green"), ("red", "5 red"), ("green", "6 none")]


def test_a_robot_that_comes_when_the_last_one_stood_at_the_light_drives() -> None:
    with board() as (simulation, *_):
        first = simulation.add_robot(RobotOptions(30), lambda _: None)
        simulation.run()
        second = simulation.add_robot(RobotOptions(30), lambda _: None)
        simulation.run()
    assert first.steps[-1].speed == 0
    assert second.steps[10].speed > 0
    assert second.unexpected == 0


def test_what_streams_and_gateway_are_worth_together_stands_beside_what_the_paper_quotes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paper, ours = experiment()["speedup_of_all"].values()
    assert (paper, ours) == (2.48, pytest.approx(30.79 / 19.32, rel=0.01))
    partly = summary(PROFILE, PICTURES, {"all_software": drive("all_software")}, interrupted=True)
    assert partly["speedup_of_all"]["ours"] is None
    monkeypatch.setattr(driving, "run_variant", lambda _, variant, __: drive(variant))
    done = CliRunner().invoke(app, ["driving", "--pictures", str(PICTURES), "--out", str(tmp_path)])
    assert f"speedup by streams and gateway: {ours:.2f}" in done.stdout


def test_anchors_need_their_variants() -> None:
    assert anchors({}) == []
    assert [anchor["name"] for anchor in anchors({"gateways": 20.0})] == ["chain, gateways [ms]"]


@pytest.mark.parametrize("profile", ["native", "miniitx-zynq7100"])
def test_a_profile_without_topics_is_refused(profile: str) -> None:
    with pytest.raises(UsageError, match="Use --profile zcu104"):
        check_profile(read_profile(profile))


@pytest.mark.parametrize("section", ["gateway", "hmt"])
def test_a_profile_without_what_one_of_the_variants_needs_is_refused(section: str) -> None:
    assert PROFILE.model is not None
    lacking = PROFILE.model_copy(update={"model": PROFILE.model.model_copy(update={section: None})})
    with pytest.raises(UsageError, match=rf"Add a section \[model\.{section}\]"):
        check_profile(lacking)


def test_a_picture_of_another_size_is_refused() -> None:
    class Picture:
        encoding, height, width, step, data = "bgr8", 1, 1, 3, b"..."

    with pytest.raises(BadMessageError, match="not 480, 640"):
        check_picture(Picture)


def test_a_robot_that_nobody_drives_gives_up() -> None:
    with Simulation(TypeRegistry()) as simulation:
        simulation.add_robot(RobotOptions(1, wait_s=0.5), lambda _: None)
        with pytest.raises(TransportError, match="nobody in domain 0 subscribed to /image_raw"):
            simulation.run()


def test_the_command_writes_records_object_and_drawing(tmp_path: Path) -> None:
    result = CliRunner().invoke(
        app, ["driving", "--pictures", str(PICTURES), "--out", str(tmp_path), "--json"]
    )
    assert result.exit_code == 0
    printed = json.loads(result.stdout)
    assert printed == json.loads((tmp_path / "experiment.json").read_text())
    assert printed["variants"] == experiment()["variants"]
    assert {path.name for path in tmp_path.iterdir()} == {
        *VARIANTS,
        "experiment.json",
        "driving.png",
    }
    with (tmp_path / "gateways" / "pictures.tsv").open() as file:
        rows = list(csv.DictReader(file, dialect="excel-tab"))
    assert len(rows) == PICTURES
    assert rows[0]["loop_ms"] == ""
    assert float(rows[1]["loop_ms"]) == drive("gateways").loop_ms[1]


def test_an_interrupted_drive_keeps_the_variants_that_are_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(_: object, variant: str, __: int) -> Drive:
        if variant == "gateways":
            raise KeyboardInterrupt
        return drive(variant)

    monkeypatch.setattr(driving, "run_variant", run)
    result = CliRunner().invoke(app, ["driving", "--pictures", str(PICTURES), "--out", str(tmp_path)])
    assert result.exit_code == 130
    assert "interrupted before its end" in result.stdout
    kept = json.loads((tmp_path / "experiment.json").read_text())
    assert kept["interrupted"]
    assert list(kept["variants"]) == ["all_software", "hardware_topics"]
    assert (tmp_path / "driving.png").exists()


def test_a_board_to_which_no_picture_comes_is_an_error(tmp_path: Path) -> None:
    text = (files("reconros_zenoh.board.profiles") / "zcu104.toml").read_text(encoding="utf-8")
    profile = tmp_path / "lossy.toml"
    profile.write_text(text.replace("loss_probability = { value = 0,", "loss_probability = { value = 1,"))
    with pytest.raises(ExperimentError, match="all_software: no picture came through"):
        run_variant(read_profile(str(profile)), "all_software", 20)
