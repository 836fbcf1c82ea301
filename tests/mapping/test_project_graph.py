"""The computation graph of a project file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from camera_project import CAMERA, gateway, read

from reconros_zenoh.errors import FileError
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.mapping.communication import TopicMapping, map_topics
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.mapping.project_graph import OUTSIDE, read_project_graph, shared_slots
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.mapping_file import CallbackMapping, ProjectMapping
from reconros_zenoh.ros.type_registry import TypeRegistry

if TYPE_CHECKING:
    from pathlib import Path

HW, SW = Side.HARDWARE, Side.SOFTWARE
FROM_OUTSIDE, TO_OUTSIDE = OUTSIDE.values()


def graph_of(folder: Path, text: str = CAMERA) -> ComputationGraph:
    """Return the graph of this project file under the mapping of a project without mapping files."""
    configuration = read(folder, text)
    return read_project_graph(configuration, ProjectMapping.default(configuration))


def topics(graph: ComputationGraph) -> dict[str, tuple[str, str]]:
    return {t.name: (" ".join(t.publishers), " ".join(t.subscribers)) for t in graph.topics}


def test_nodes_and_topics_have_their_full_names(tmp_path: Path) -> None:
    graph = graph_of(tmp_path)
    assert graph.nodes == {"/edge": HW, "/vision/lane": HW, "/viewer": SW, FROM_OUTSIDE: SW}
    assert topics(graph) == {
        "/image": (FROM_OUTSIDE, "/edge /vision/lane"),
        "/edges": ("/edge", "/vision/lane"),
        "/vision/lane/found": ("/vision/lane", "/viewer"),
    }
    assert {name: decision.mapping for name, decision in map_topics(graph).items()} == {
        "/image": TopicMapping.GATEWAY,
        "/edges": TopicMapping.HARDWARE,
        "/vision/lane/found": TopicMapping.SOFTWARE,
    }
    assert any("Services and actions are left out" in note for note in graph.notes)
    assert any(FROM_OUTSIDE in note for note in graph.notes)


def test_what_nobody_in_the_project_reads_leaves_it(tmp_path: Path) -> None:
    alone = CAMERA[: CAMERA.index("[ResourceGroup@viewer]")] + (
        "[ReconosThread@lane]\nSlot = slot(1)\nHwSource = hls\nResourceGroup = lane\n"
    )
    graph = graph_of(tmp_path, alone)
    assert topics(graph)["/vision/lane/found"] == ("/vision/lane", TO_OUTSIDE)
    # No thread uses the group of /edge: main.py does, in software.
    assert graph.nodes["/edge"] is SW
    assert not any("Services" in note for note in graph.notes)


def mapping_of(**slots: tuple[int, ...]) -> ProjectMapping:
    return ProjectMapping(
        name="test",
        executor="reconros",
        software_workers=1,
        hardware_workers=3,
        callbacks={name: CallbackMapping(software=not given, slots=given) for name, given in slots.items()},
    )


def test_a_mapping_decides_what_is_in_hardware(tmp_path: Path) -> None:
    graph = read_project_graph(read(tmp_path), mapping_of(edge=(0,), lane=(), viewer=()))
    assert (graph.nodes["/edge"], graph.nodes["/vision/lane"]) == (HW, SW)
    decisions = map_topics(graph)
    assert {decision.mapping for decision in decisions.values()} == {TopicMapping.SOFTWARE}


def test_a_stream_between_callbacks_that_share_slots_is_noted(tmp_path: Path) -> None:
    configuration = read(tmp_path)
    in_hardware = dict.fromkeys(("/image", "/edges", "/vision/lane/found"), TopicMapping.HARDWARE)

    def notes(edge: tuple[int, ...], lane: tuple[int, ...]) -> list[str]:
        return shared_slots(configuration, mapping_of(edge=edge, lane=lane, viewer=()), in_hardware)

    assert notes((0,), (1,)) == []
    (note,) = notes((0,), (0,))
    assert note.startswith("edge and lane share slot 0: a stream between them (/edges) may block, or reconf")
    assert notes((2, 0, 1), (1, 2))[0].startswith("edge and lane share slots 1, 2: ")
    in_hardware["/edges"] = TopicMapping.SOFTWARE
    assert notes((0,), (0,)) == []


@pytest.mark.parametrize("end", ["rospub", "rossub"])
def test_two_that_both_publish_or_both_read_join_no_stream(tmp_path: Path, end: str) -> None:
    same = f'alike = {end}, node, image_msg, "/alike"\n'
    marks = [f"image_msg = rosmsg, sensor_msgs, msg, Image\n{rest}" for rest in ("sub =", "int_msg =")]
    text = CAMERA
    for mark in marks:
        assert mark in text
        text = text.replace(mark, mark.replace("Image\n", f"Image\n{same}"))
    configuration = read(tmp_path, text)
    mapping = mapping_of(edge=(0,), lane=(0,), viewer=())
    streams = dict.fromkeys(("/image", "/edges", "/vision/lane/found"), TopicMapping.SOFTWARE)
    assert shared_slots(configuration, mapping, streams | {"/alike": TopicMapping.HARDWARE}) == []


def test_a_node_with_callbacks_on_both_sides_is_a_node_on_each(tmp_path: Path) -> None:
    both = CAMERA.replace('"/vision/lane"', '"/edge"').replace("HwSource = hls\nSwSource", "SwSource")
    graph = graph_of(tmp_path, both)
    inside = {"/edge (hardware)": HW, "/edge (software)": SW, "/viewer": SW}
    assert graph.nodes == inside | {FROM_OUTSIDE: SW, TO_OUTSIDE: SW}
    assert topics(graph)["/edges"] == ("/edge (hardware)", "/edge (software)")


def test_the_two_topics_of_a_gateway_are_one(tmp_path: Path) -> None:
    streamed = CAMERA.replace(
        'image = rossub, node, image_msg, "/image"\n',
        'image = rossub, node, sensor_msgs/Image, "/stream", hw\n',
    )
    assert topics(graph_of(tmp_path, streamed + gateway("image", 2, "/stream", "/image"))) == topics(
        graph_of(tmp_path)
    )


def test_a_gateway_has_ends_in_software_even_if_the_project_has_none(tmp_path: Path) -> None:
    edges = gateway("edges", 2, "/stream", "/edges")
    assert topics(graph_of(tmp_path, CAMERA + edges))["/edges"] == (
        "/edge",
        f"/vision/lane {TO_OUTSIDE}",
    )


def test_a_name_that_ros_2_does_not_allow(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="left arm") as caught:
        graph_of(tmp_path, CAMERA.replace('"/edges"', '"/left arm"'))
    assert caught.value.line == CAMERA[: CAMERA.index('"/edges"')].count("\n") + 1


def test_the_shipped_project() -> None:
    project = load_project(application_folder())
    graph = read_project_graph(project.configuration, project.mapping("mixed"))
    assert graph.nodes == {
        "/inverse_node": HW,
        "/mnist_node": HW,
        "/sobel_node": HW,
        "/hash_node": SW,
        FROM_OUTSIDE: SW,
        TO_OUTSIDE: SW,
    }
    assert Topic("/image_raw", (FROM_OUTSIDE,), ("/sobel_node",)) in graph.topics


SIZED = """\
[General]
Name = sized

[ResourceGroup@talk]
node = rosnode, "/talk"
word_msg = rosmsg, std_msgs, msg, UInt32
text_msg = rosmsg, std_msgs, msg, String
list_msg = rosmsg, std_msgs, msg, UInt8MultiArray
pose_msg = rosmsg, geometry_msgs, msg, PoseWithCovariance
word = rospub, node, word_msg, "/word"
text = rospub, node, text_msg, "/text"
list = rospub, node, list_msg, "/list"
pose = rospub, node, pose_msg, "/pose"
"""


def test_a_topic_has_the_size_of_its_messages_where_all_are_of_one(tmp_path: Path) -> None:
    configuration = read(tmp_path, SIZED)
    graph = read_project_graph(configuration, ProjectMapping.default(configuration), TypeRegistry())
    sizes = {topic.name: topic.size for topic in graph.topics}
    assert sizes == {"/word": 4 + 4, "/text": None, "/list": None, "/pose": 4 + (7 + 36) * 8}
    assert {topic.size for topic in graph_of(tmp_path, SIZED).topics} == {None}


def test_a_size_needs_a_type_that_somebody_defines(tmp_path: Path) -> None:
    configuration = read(tmp_path, SIZED.replace("String", "Strign"))
    mapping = ProjectMapping.default(configuration)
    with pytest.raises(FileError, match=r"build\.cfg:11: text: The type 'std_msgs/msg/Strign' is not known"):
        read_project_graph(configuration, mapping, TypeRegistry())
