"""The command `reconros map`, in this process."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
import typer
from camera_project import CAMERA, write
from mapped_graphs import EXAMPLE
from typer.testing import CliRunner

from reconros_zenoh.cli.map import map_communication
from reconros_zenoh.errors import FileError, UsageError

if TYPE_CHECKING:
    from pathlib import Path

application = typer.Typer()
application.command("map")(map_communication)


def run(*arguments: object, columns: int = 100) -> str:
    """Return what the command prints; raise what it raises."""
    result = CliRunner().invoke(application, [str(a) for a in arguments], env={"COLUMNS": str(columns)})
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


def run_json(*arguments: object) -> dict[str, Any]:
    return json.loads(run(*arguments, "--json"))  # type: ignore[no-any-return]


def test_the_example_as_json() -> None:
    result = run_json(EXAMPLE)
    assert (result["t_sw"], result["t_hw"], result["t_gw"]) == (["D"], ["B"], ["A", "C", "E"])
    assert result["crossings"] == {"all_software": 10, "hardware_topics": 8, "gateways": 3}
    assert result["crossing_edges"] == [
        {"from": "A", "to": "n8"},
        {"from": "C", "to": "n6"},
        {"from": "n9", "to": "E"},
    ]
    mappings = {topic["name"]: topic["mapping"] for topic in result["topics"]}
    assert mappings == {"A": "gateway", "B": "hardware", "C": "gateway", "D": "software", "E": "gateway"}
    assert all(topic["reason"].endswith(".") for topic in result["topics"])
    assert (result["notes"], result["warnings"]) == ([], [])
    assert "predicted" not in result


def test_the_example_as_a_table() -> None:
    output = run(EXAMPLE, columns=200)
    assert "T_SW = {D}   T_HW = {B}   T_GW = {A, C, E}" in output
    for words in (
        "10 (3 pub, 7 sub) with every topic in software",
        "8 (2 pub, 6 sub) with T_HW",
        "3 (1 pub, 2 sub) with gateways",
    ):
        assert words in output
    assert "\x1b" not in output


def test_names_are_no_markup(tmp_path: Path) -> None:
    graph = tmp_path / "graph.yaml"
    graph.write_text("nodes: {'[red]n': hardware}\ntopics: {'[b]t': {publishers: ['[red]n']}}")
    output = run(graph)
    assert "[red]n" in output
    assert "T_HW = {[b]t}" in output


def test_predictions_stand_beside_the_rule(tmp_path: Path, profile_file: Path) -> None:
    graph = tmp_path / "graph.yaml"
    graph.write_text(
        "nodes: {h: hardware, i: hardware, j: hardware, s: software}\n"
        "topics:\n"
        "  small: {publishers: [h], subscribers: [i, j, s], size: 10_000, rate: 34.6}\n"
        "  large: {publishers: [h], subscribers: [i, j, s], size: 1_000_000, rate: 34.6}\n"
        "  inside: {publishers: [h], subscribers: [i], size: 1000, rate: 1}\n"
    )
    result = run_json(graph, "--model", profile_file)
    assert (result["t_sw"], result["t_hw"], result["t_gw"]) == ([], ["inside"], ["large", "small"])
    predicted = result["predicted"]
    assert predicted["model"] == "transfers"
    assert (predicted["t_sw"], predicted["t_hw"], predicted["t_gw"]) == (["small"], ["inside"], ["large"])
    # small: h, i and j cross (3); large: s crosses.
    assert predicted["crossings"] == 4
    loads = predicted["memif_load"]
    assert loads["rule"] == pytest.approx(0.101, rel=1e-3)
    assert loads["predicted"] == pytest.approx(0.103, rel=1e-3)
    assert loads["all_software"] == pytest.approx(0.303, rel=1e-3)
    small, large, inside = (topic["predicted"] for topic in result["topics"])
    assert (small["mapping"], large["mapping"], inside["mapping"]) == ("software", "gateway", "hardware")
    assert large["smt"]["hw_max_ms"] == pytest.approx(0.1769 + 2 * (0.0072 + 1 / 0.346), rel=1e-3)
    assert large["gateway"]["hw_max_ms"] == pytest.approx(0.2113 + 1 / 0.346, rel=1e-3)
    assert small["changeover"]["mapping"] == "gateway"
    assert small["changeover"]["bytes"] == pytest.approx(45_000, rel=0.01)
    assert (inside["smt"], inside["changeover"]) == (None, None)
    output = run(graph, "--model", profile_file, columns=200)
    for words in (
        "By the transfer times of transfers:",
        "gateway from 4",
        "T_SW = {small}",
        "10.3 % as predic",
    ):
        assert words in output


def test_a_warning_is_no_part_of_the_result(tmp_path: Path) -> None:
    graph = tmp_path / "graph.yaml"
    graph.write_text("nodes: {n: software}\ntopics: {A: {publishers: [n]}}")
    result = CliRunner().invoke(application, [str(graph)])
    assert "warning: topic A has no subscriber." in result.stderr
    assert "warning" not in result.stdout
    assert run_json(graph)["warnings"] == ["topic A has no subscriber."]


def test_a_drawing(tmp_path: Path) -> None:
    assert "drawn to" in run(EXAMPLE, "--plot", tmp_path / "graph.dot")
    assert (tmp_path / "graph.dot").read_text().startswith("digraph")


def test_a_project_is_mapped_and_written_once(tmp_path: Path) -> None:
    path = write(tmp_path)
    result = run_json(tmp_path)
    assert (result["t_sw"], result["t_hw"], result["t_gw"]) == (
        ["/vision/lane/found"],
        ["/edges"],
        ["/image"],
    )
    assert "applied" not in result
    assert path.read_text(encoding="utf-8") == CAMERA
    output = run(tmp_path, "--apply")
    assert 'edges = rossub, node, sensor_msgs/Image, "/edges", hw' in output
    assert "[ROSGateway@image]" in path.read_text(encoding="utf-8")
    assert run_json(tmp_path, "--apply") == result | {"applied": []}
    assert "nothing to add to build.cfg" in run(tmp_path, "--apply")


def test_a_stream_that_is_one_no_more_is_told_of_and_stays(tmp_path: Path) -> None:
    path = write(tmp_path)
    run(tmp_path, "--apply")
    second_reader = 'image = rossub, node, sensor_msgs/Image, "/image", hw\n'
    text = path.read_text(encoding="utf-8")
    assert second_reader in text
    path.write_text(text.replace(second_reader, ""), encoding="utf-8")
    result = run_json(tmp_path, "--apply")
    assert result["t_sw"] == ["/image", "/vision/lane/found"]
    assert result["applied"] == []
    (warning,) = result["warnings"]
    line = text[: text.index('sub = rossub, node, sensor_msgs/Image, "/image", hw')].count("\n") + 1
    assert warning.startswith(f"{path}:{line}: /image stays hardware-mapped, as --apply takes nothing back.")


def test_a_mapping_of_the_project(tmp_path: Path) -> None:
    write(tmp_path, CAMERA.replace("[ReconosThread@edge]", "[ReconosThread@edge]\nSwSource = c"))
    (tmp_path / "main.py").write_text("def main(app): ...")
    (tmp_path / "soft.toml").write_text(
        'executor = "standard"\nsoftware_workers = 1\n'
        "[callbacks]\nedge.software = true\nlane.software = true\nviewer.software = true\n"
    )
    result = run_json(tmp_path, "--mapping", tmp_path / "soft.toml")
    assert result["t_sw"] == ["/edges", "/image", "/vision/lane/found"]


HARD = """\
executor = "reconros"
software_workers = 1
[callbacks]
edge.slots = [0]
lane.slots = [1]
viewer.software = true
"""
SOFT = HARD.replace("lane.slots = [1]", "lane.software = true")


def write_mappings(folder: Path, **mappings: str) -> None:
    (folder / "mappings").mkdir()
    for name, text in mappings.items():
        (folder / "mappings" / f"{name}.toml").write_text(text, encoding="utf-8")


def test_without_a_mapping_it_takes_that_of_run_and_says_which(tmp_path: Path) -> None:
    write(tmp_path)
    assert "Callbacks are where the mapping 'default' has them" in run_json(tmp_path)["notes"][0]
    write_mappings(tmp_path, a_soft=SOFT, hard=HARD)
    result = run_json(tmp_path)
    assert "Callbacks are where the mapping 'a_soft' has them" in result["notes"][0]
    assert (result["t_hw"], result["t_gw"]) == ([], [])
    assert result == run_json(tmp_path, "--mapping", "a_soft")
    assert run_json(tmp_path, "--mapping", "hard")["t_hw"] == ["/edges"]


def test_mappings_that_a_change_makes_unusable_are_named(tmp_path: Path) -> None:
    write(tmp_path)
    write_mappings(tmp_path, a_soft=SOFT, broken="executor = 1", hard=HARD)
    warnings = run_json(tmp_path, "--mapping", "hard", "--apply")["warnings"]
    (about_soft,) = warnings
    path = tmp_path / "mappings" / "a_soft.toml"
    assert about_soft.startswith(f"{path} cannot be used any more: {tmp_path / 'build.cfg'}:")
    assert "The callback lane is mapped to software, but" in about_soft
    assert run_json(tmp_path, "--mapping", "hard", "--apply")["warnings"] == []
    with pytest.raises(FileError, match="The callback lane is mapped to software"):
        run(tmp_path)


def test_a_stream_through_a_shared_slot_is_noted(tmp_path: Path) -> None:
    note = "edge and lane share slot 0: a stream between them (/edges) may block"
    shared = CAMERA.replace("slot(1)", "slot(0)").replace("Reconfigurable = false", "Reconfigurable = true")
    write(tmp_path, shared)
    assert note in run_json(tmp_path)["notes"][-1]
    assert note in run(tmp_path, columns=200)


def test_warnings_of_the_project_file_are_told(tmp_path: Path) -> None:
    write(tmp_path, f"{CAMERA}\n[Unheard@of]\n")
    assert any("unknown section [Unheard@of]" in warning for warning in run_json(tmp_path)["warnings"])


def test_a_mistake_that_follows_from_a_warning_comes_behind_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path, CAMERA.replace("HwSource", "HwSorce"))
    write_mappings(tmp_path, hard=HARD)
    with pytest.raises(FileError, match="which its thread is not built for"):
        run(tmp_path)
    assert "the unknown option HwSorce is left out." in caplog.text


REFUSED: dict[str, tuple[tuple[object, ...], str]] = {
    "nothing": ((), "nothing to map"),
    "two sources": ((EXAMPLE, "--live"), "Give one of the two"),
    "a node of a graph file": ((EXAMPLE, "--hardware", "n6"), "--hardware names nodes of --live"),
    "a mapping of a graph file": ((EXAMPLE, "--mapping", "x"), "--mapping needs the folder of a project"),
    "a graph file to write to": ((EXAMPLE, "--apply"), "--apply needs the folder of a project"),
    "no source": (("gone",), "gone is no folder"),
    "a model without times": ((EXAMPLE, "--model", "native"), "has no transfer times of topics"),
    "another drawing": ((EXAMPLE, "--plot", "graph.pdf"), "drawings are written as svg, png or dot"),
}


@pytest.mark.parametrize(("arguments", "says"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_done_is_refused(arguments: tuple[object, ...], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        run(*arguments)


def test_a_folder_without_a_project(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"build\.cfg: cannot be read"):
        run(tmp_path)


def test_what_check_refuses_is_not_mapped(tmp_path: Path) -> None:
    streams = "".join(f"{name} = rospub, node, sensor_msgs/{name}, /s, hw\n" for name in ("Image", "Imu"))
    path = write(tmp_path, f'[ResourceGroup@g]\nnode = rosnode, "/n"\n{streams}')
    with pytest.raises(FileError, match=f"{path}:4: /s has the type sensor_msgs/msg/Imu here"):
        run(tmp_path)
