"""The graph of what runs: nodes of two sessions in a simulated network."""

from __future__ import annotations

import pytest

from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import UsageError
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.mapping.live_graph import read_live_graph
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

HW, SW = Side.HARDWARE, Side.SOFTWARE


@pytest.fixture
def network() -> SimulatedNetwork:
    """A camera, two filters in the namespace of a robot, a viewer, and what else a ROS graph holds."""
    network = SimulatedNetwork(VirtualEnvironment())
    here, there = Context(network.transport("a1")), Context(network.transport("b2"))
    types = TypeRegistry()
    image, set_bool = types.message("sensor_msgs/msg/Image"), types.service("std_srvs/srv/SetBool")
    camera = here.node("camera")
    camera.publisher(image, "/image")
    camera.publisher(image, "/rosout")
    camera.publisher(image, "/act/_action/feedback")
    camera.service(set_bool, "on", lambda _: None)
    for name in ("edge", "lane"):
        node = there.node(name, "/robot")
        node.subscription(image, "/image", lambda _: None)
        node.publisher(image, "~/out")
    viewer = there.node("viewer")
    viewer.subscription(image, "/robot/edge/out", lambda _: None)
    viewer.subscription(image, "/nobody", lambda _: None)
    Context(network.transport("c3"), 7).node("elsewhere").publisher(image, "/image")
    return network


def read(network: SimulatedNetwork, *hardware: str) -> ComputationGraph:
    return read_live_graph(network.transport("d4"), 0, hardware)


def test_nodes_and_topics_of_the_domain(network: SimulatedNetwork) -> None:
    graph = read(network, "/robot/edge", "robot/lane")
    assert graph.nodes == {"/camera": SW, "/robot/edge": HW, "/robot/lane": HW, "/viewer": SW}
    assert sorted(graph.topics, key=lambda topic: topic.name) == [
        Topic("/image", ("/camera",), ("/robot/edge", "/robot/lane")),
        Topic("/robot/edge/out", ("/robot/edge",), ("/viewer",)),
        Topic("/robot/lane/out", ("/robot/lane",), ()),
    ]
    assert graph.warnings == ("topic /robot/lane/out has no subscriber.",)
    assert "nobody publishes on them at the moment: /nobody." in graph.notes[-1]


def test_a_node_of_streams_alone_is_in_hardware(network: SimulatedNetwork) -> None:
    Context(network.transport("e5")).node("ground")
    graph = read(network, "/ground", "/robot/edge")
    assert graph.nodes["/ground"] is HW
    (note,) = [note for note in graph.notes if "no topic in the network" in note]
    assert note.startswith("/ground runs, but ")


def test_without_a_node_in_hardware_it_says_how_to_name_them(network: SimulatedNetwork) -> None:
    graph = read(network)
    assert set(graph.nodes.values()) == {SW}
    assert any("--hardware" in note for note in graph.notes)


def test_nodes_in_hardware_that_may_be_on_several_boards_are_noted(network: SimulatedNetwork) -> None:
    note = "The nodes in hardware run in 2 processes, and a stream stays inside one board."
    assert any(note in each for each in read(network, "/camera", "/robot/edge").notes)
    assert not any("processes" in each for each in read(network, "/robot/edge", "/robot/lane").notes)


def test_a_node_that_does_not_run(network: SimulatedNetwork) -> None:
    with pytest.raises(UsageError, match=r"no node /lane runs\. Name one of /camera, /robot/edge"):
        read(network, "lane")
    with pytest.raises(UsageError, match="there is none"):
        read_live_graph(SimulatedNetwork(VirtualEnvironment()).transport("d4"), 0, ["lane"])
