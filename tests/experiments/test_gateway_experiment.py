"""Section 4 of the gateways paper in virtual time: the text's figures, and that the checks check."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from importlib.resources import as_file, files
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from reconros_zenoh.applications.gateway.nodes import ImagePublisher, random_body, run_nodes
from reconros_zenoh.board.profile import profile_path, read_profile
from reconros_zenoh.cli.experiment import app
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import ExperimentError, FileError, UsageError
from reconros_zenoh.experiments import gateway
from reconros_zenoh.experiments.gateway import (
    COUNTS,
    SIZES,
    anchors,
    measure_gateway,
    setup_mapping,
)
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.measure.gateway_plots import transmission_figure
from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.transport.simulated import SimulatedNetwork


@cache
def all_cells() -> dict[str, Any]:
    return measure_gateway("virtual", read_profile("zcu104"), Side, SIZES.values(), COUNTS, 2, lambda: None)


def test_every_figure_of_the_text_is_met_within_a_tenth() -> None:
    result = all_cells()
    assert len(result["cells"]) == 24
    assert len(result["anchors"]) == 7
    for anchor in result["anchors"]:
        assert abs(anchor["error"]) < 0.1, anchor
        assert anchor["error"] == pytest.approx(anchor["ours"] / anchor["paper"] - 1)
    assert result["host"]["overruns"] == 0


def test_the_trends_of_the_text() -> None:
    cells = {(cell["publisher"], cell["size"], cell["subscribers"]): cell for cell in all_cells()["cells"]}
    small, large = SIZES["10kB"], SIZES["10MB"]
    for count in COUNTS:
        assert (
            cells["hardware", small, count]["speedup_sw"] < cells["hardware", large, count]["speedup_sw"] <= 1
        )
    assert cells["software", small, 2]["speedup_hw"] < 1
    for publisher in Side:
        for size in SIZES.values():
            speedups = [cells[publisher, size, count]["speedup_hw"] for count in COUNTS]
            assert speedups == sorted(speedups)
    assert all(
        cells["hardware", size, count]["speedup_hw"] > 1 for size in SIZES.values() for count in COUNTS
    )
    assert all(
        cells["software", size, count]["speedup_sw"] > 1 for size in SIZES.values() for count in COUNTS
    )


def test_anchors_need_their_cells() -> None:
    assert anchors([]) == []


@pytest.mark.parametrize("publisher", Side)
@pytest.mark.parametrize(("variant", "transfers"), [("smt", 4), ("bridged", 1)])
def test_one_memif_transfer_per_message_with_a_gateway(publisher: Side, variant: str, transfers: int) -> None:
    environment = VirtualEnvironment()
    got: list[str] = []

    def note(name: str, *_: int) -> None:
        got.append(name)

    body = random_body(SIZES["100kB"])
    with as_file(files("reconros_zenoh.applications.gateway") / variant) as folder:
        project = load_project(folder)
    hosted = HostedBoard(
        environment,
        SimulatedNetwork(environment).transport("b0"),
        read_profile("zcu104"),
        replace(
            project, main=lambda app: run_nodes(app, body, on_received=lambda name, *_: got.append(name))
        ),
        setup_mapping(publisher, 4),
        BoardOptions(),
    )
    environment.run(until=1_500_000_000)  # the timer's first period, and time enough for one message
    hosted.close()
    assert sorted(got) == ["hardware_0", "hardware_1", "hardware_2", "hardware_3", "software"]
    # In hardware the publisher of an SMT writes the message to memory first.
    writes = variant == "smt" and publisher is Side.HARDWARE
    model = hosted.board.profile.model
    assert model is not None
    at_once_ns = round((transfers + writes) * len(body) / model.memif.bandwidth.bytes_per_ns)
    assert hosted.board.memif.bus.use(at_once_ns) == pytest.approx(1, rel=0.001)


def test_a_wrong_body_ends_the_experiment(monkeypatch: pytest.MonkeyPatch) -> None:
    right = ImagePublisher._image

    def wrong(self: ImagePublisher, now_ns: int) -> Any:
        image = right(self, now_ns)
        image.data = np.zeros_like(image.data)
        return image

    monkeypatch.setattr(ImagePublisher, "_image", wrong)
    with pytest.raises(ExperimentError, match="message 1 reached 0 of 3 subscribers rightly"):
        gateway._run("virtual", read_profile("zcu104"), "smt", Side.HARDWARE, 2, random_body(100), 1)


def run(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["gateway", "--repeat", "1", *arguments])


def test_a_profile_without_topics_is_refused_and_an_earlier_result_is_kept(tmp_path) -> None:
    earlier = tmp_path / "gateway.json"
    earlier.write_text("{}")
    result = run("--profile", "miniitx-zynq7100", "--out", str(tmp_path))
    assert isinstance(result.exception, UsageError)
    assert "does not know what topics inside a board cost" in str(result.exception)
    assert earlier.read_text() == "{}"


@pytest.mark.parametrize("section", ["gateway", "hmt", "callbacks.hardware_7"])
def test_a_profile_that_lacks_a_time_is_refused_and_an_earlier_result_is_kept(section: str, tmp_path) -> None:
    shipped = profile_path("zcu104").read_text()
    lacking = tmp_path / "lacking.toml"
    parts = shipped.split("\n\n")
    lacking.write_text("\n\n".join(part for part in parts if not part.startswith(f"[model.{section}]")))
    assert lacking.read_text() != shipped
    earlier = tmp_path / "gateway.json"
    earlier.write_text("{}")
    result = run("--profile", str(lacking), "--out", str(tmp_path))
    assert isinstance(result.exception, FileError | UsageError)
    assert f"[model.{section}]" in str(result.exception)
    assert earlier.read_text() == "{}"


def test_the_command_prints_one_json_object_and_draws(tmp_path) -> None:
    result = run("--sizes", "10kB", "--subscribers", "2,4", "--json", "--out", str(tmp_path))
    assert result.exit_code == 0
    printed = json.loads(result.stdout)
    assert [(cell["publisher"], cell["size"], cell["subscribers"]) for cell in printed["cells"]] == [
        (publisher, 10_000, count) for publisher in Side for count in (2, 4)
    ]
    cell = printed["cells"][0]
    assert set(cell) == {"publisher", "size", "subscribers", "smt", "gateway", "speedup_hw", "speedup_sw"}
    assert set(cell["smt"]) == set(cell["gateway"]) == {"hw_max_ms", "sw_ms", "lost"}
    assert {"date", "command", "versions"} <= set(printed)
    assert json.loads((tmp_path / "gateway.json").read_text()) == printed
    assert {path.name for path in tmp_path.glob("*.png")} == {
        "fig6_hardware_publisher.png",
        "fig7_software_publisher.png",
    }


def test_what_was_measured_before_an_interruption_is_kept(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    measure = gateway._run
    runs: list[object] = []

    def interrupted(*arguments: Any) -> Any:
        runs.append(arguments)
        if len(runs) > 2:  # SMT and gateway of the first cell
            raise KeyboardInterrupt
        return measure(*arguments)

    monkeypatch.setattr(gateway, "_run", interrupted)
    result = run("--sizes", "10kB", "--subscribers", "2,4", "--json", "--out", str(tmp_path))
    assert result.exit_code == 130
    printed = json.loads(result.stdout)
    assert printed["interrupted"] is True
    assert [cell["subscribers"] for cell in printed["cells"]] == [2]
    assert json.loads((tmp_path / "gateway.json").read_text()) == printed


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_measured(
    tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(gateway, "_run")
    (tmp_path / "file").touch()  # not even root can make a folder below it
    result = run("--out", str(tmp_path / "file" / "x"))
    assert isinstance(result.exception, UsageError)
    assert "Choose another --out" in str(result.exception)


def test_the_command_prints_a_table(tmp_path) -> None:
    result = run("--sizes", "10kB,10MB", "--publisher", "software", "--out", str(tmp_path))
    assert "from software" in result.stdout
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["to", "HW", "to", "SW"] in lines
    assert ["kB", "subscribers", "SMT", "gateway", "speedup", "SMT", "gateway", "speedup"] in lines
    assert "from hardware" not in result.stdout
    assert "software to software, smallest: speedup 1.06, paper 1.06" in result.stdout
    assert "…" not in result.stdout


def test_points_of_one_size_tell_the_number_of_subscribers() -> None:
    cells = [cell for cell in all_cells()["cells"] if cell["size"] == 10_000]
    figure = transmission_figure({**all_cells(), "cells": cells}, "hardware")
    markers = {line.get_marker() for line in figure.axes[0].get_lines()}
    shown = {handle.get_marker() for handle in figure.legends[0].legend_handles}
    assert len(markers) == 3
    assert markers <= shown
    assert figure.get_supxlabel() == "message size; profile zcu104, virtual time"


@pytest.mark.parametrize(
    ("option", "text", "words"),
    [
        ("--sizes", "10", "'10' is no message size"),
        ("--sizes", "0kB", "'0kB' is no message size"),
        ("--sizes", "1001MB", "Write whole numbers of B, kB or MB up to 1000MB"),
        ("--subscribers", "2,9", "'2,9' are no numbers of subscribers"),
        ("--subscribers", "", "are no numbers of subscribers"),
    ],
)
def test_what_cannot_be_measured_is_refused(option: str, text: str, words: str) -> None:
    result = run(option, text)
    assert isinstance(result.exception, UsageError)
    assert words in str(result.exception)


@pytest.mark.parametrize("variant", ["smt", "bridged"])
def test_the_projects_run_with_a_publisher_on_each_side(variant: str) -> None:
    environment = VirtualEnvironment()
    with as_file(files("reconros_zenoh.applications.gateway") / variant) as folder:
        project = load_project(folder)
    assert not project.configuration.warnings
    hosted = HostedBoard(
        environment,
        SimulatedNetwork(environment).transport("b0"),
        read_profile("zcu104"),
        project,
        project.mapping("both_publishers"),
        BoardOptions(),
    )
    environment.run(until=3_500_000_000)
    for name, callback in hosted.executor.statistics().items():
        assert (callback["calls"], callback["failed"]) == (3 if name.startswith("publisher") else 6, 0), name
    hosted.close()
