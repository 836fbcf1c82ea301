"""Section 6 of the gateways paper in virtual time: the chain of nodes, and that the robot drives by it."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from functools import cache
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

import pytest
from typer.testing import CliRunner

from board_daemon.hosting import BoardOptions
from host_clients.robot import RobotOptions
from reconros_zenoh.applications.driving.nodes import check_picture
from reconros_zenoh.applications.driving.world import RED_S
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.experiment import app
from reconros_zenoh.errors import BadMessageError, ExperimentError, TransportError, UsageError
from reconros_zenoh.experiments import driving
from reconros_zenoh.experiments.driving import (
    SECTIONS,
    VARIANTS,
    Drive,
    all_right,
    anchors,
    check_profile,
    run_variant,
    summary,
)
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.mapping.communication import Crossings, map_topics
from reconros_zenoh.mapping.project_graph import read_project_graph
from reconros_zenoh.project.loader import load_project, read_project
from reconros_zenoh.ros.types import TypeRegistry

if TYPE_CHECKING:
    from pathlib import Path

PICTURES = 70
PROFILE = read_profile("zcu104")
IMAGE_BYTES = 640 * 480 * 3
PIXEL_PER_CYCLE_MS = 640 * 480 / 100_000


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
    assert all_right(experiment())


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
    with as_file(files("reconros_zenoh.applications.driving")) as folder:
        project = load_project(folder)
    with Simulation(project.types()) as simulation:
        simulation.add_board(PROFILE, project, project.mapping(None), BoardOptions())
        simulation.context().node("desktop").subscription(
            project.types().message("std_msgs/msg/UInt32"),
            "/matches",
            lambda received: matches.append(received.message.data),
        )
        simulation.add_robot(RobotOptions("", 5), lambda _: None)
        simulation.run()
    first, *others = matches
    assert first == 0
    assert len(others) == 4
    assert all(count > 200 for count in others)


def test_the_method_finds_the_gateway_of_the_paper() -> None:
    with as_file(files("reconros_zenoh.applications.driving")) as folder:
        graph = read_project_graph(read_project(folder).configuration)
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
    ("key", "value"),
    [("answered", PICTURES - 2), ("unexpected", 1), ("most_off_lane_mm", 200.0), ("stood_s", 0.0)],
)
def test_what_goes_wrong_in_a_drive_is_not_all_right(key: str, value: float) -> None:
    variants = experiment()["variants"]
    changed = {**variants, "gateways": {**variants["gateways"], key: value}}
    assert not all_right({**experiment(), "variants": changed})
    assert not all_right({**experiment(), "interrupted": True})


def test_anchors_need_their_variants() -> None:
    assert anchors({}) == []
    assert [anchor["name"] for anchor in anchors({"gateways": 20.0})] == ["chain, gateways [ms]"]


@pytest.mark.parametrize("profile", ["native", "miniitx-zynq7100"])
def test_a_profile_without_topics_is_refused(profile: str) -> None:
    with pytest.raises(UsageError, match="Use --profile zcu104"):
        check_profile(read_profile(profile))


def test_a_picture_of_another_size_is_refused() -> None:
    class Picture:
        encoding, height, width, step, data = "bgr8", 1, 1, 3, b"..."

    with pytest.raises(BadMessageError, match="not 480, 640"):
        check_picture(Picture)


def test_a_robot_that_nobody_drives_gives_up() -> None:
    with Simulation(TypeRegistry()) as simulation:
        simulation.add_robot(RobotOptions("", 1, wait_s=0.5), lambda _: None)
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
        *(f"{name}.csv" for name in VARIANTS),
        "experiment.json",
        "driving.png",
    }
    with (tmp_path / "gateways.csv").open() as file:
        rows = list(csv.DictReader(file))
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


def test_a_robot_that_never_stops_has_not_stood() -> None:
    """That it stands until its first command is not heeding the light."""
    measured = drive("gateways")
    never = replace(measured, steps=[step for step in measured.steps if step.speed or step.seconds < 0.5])
    (variant,) = summary(PROFILE, PICTURES, {"gateways": never}, interrupted=False)["variants"].values()
    assert variant["stood_s"] == 0


def test_a_board_to_which_no_picture_comes_is_an_error(tmp_path: Path) -> None:
    text = (files("reconros_zenoh.board.profiles") / "zcu104.toml").read_text(encoding="utf-8")
    profile = tmp_path / "lossy.toml"
    profile.write_text(text.replace("loss_probability = { value = 0,", "loss_probability = { value = 1,"))
    with pytest.raises(ExperimentError, match="all_software: no picture came through"):
        run_variant(read_profile(str(profile)), "all_software", 20)
