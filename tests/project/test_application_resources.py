"""The resources of build.cfg as main.py gets them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import UsageError
from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.mapping_file import ProjectMapping
from reconros_zenoh.rmw.action_client import ActionClient
from reconros_zenoh.ros.graph import NodeToken, parse
from reconros_zenoh.ros.qos import QosProfile, Reliability
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from pathlib import Path

    from reconros_zenoh.project.application import Application
    from reconros_zenoh.ros.types import ActionType

BUILD_CFG = """
[General]
Name = shared
CPUArchitecture = arm64

[Clock@fast]
ClockSource = static
ClockFreq = 200000000

[HwSlot@slot(0:0)]
Id = 0
Clock = fast
Reconfigurable = true
Region_0 = SLICE_X0Y0:SLICE_X9Y9

[ResourceGroup@os]
box = mbox, 2
lock = mutex
changed = cond, lock
free = sem, 3
ram = mem, 16

[ResourceGroup@ros]
node = rosnode, "/robot/arm"
word = rosmsg, std_msgs, msg, UInt32
flip = rossrvmsg, std_srvs, srv, SetBool
fibonacci = rosactionmsg, example_interfaces, action, Fibonacci
sub = rossub, node, word, "in"
pub = rospub, node, word, "out"
stream_in = rossub, node, std_msgs/UInt32, "stream", hw
stream_out = rospub, node, std_msgs/UInt32, "stream", hw
ask = rossrvc, node, flip, "flip"
act = rosactions, node, fibonacci, "serve"
want = rosactionc, node, fibonacci, "want"
"""
MAIN = "from reconros_zenoh.board.executor import Executor\ndef main(app):\n"
MAIN += "    app.spin(Executor(app.board, 1, 1))\n"


@pytest.fixture
def hosted(tmp_path: Path) -> HostedBoard:
    (tmp_path / "build.cfg").write_text(BUILD_CFG)
    (tmp_path / "main.py").write_text(MAIN)
    environment = VirtualEnvironment()
    return HostedBoard(
        environment,
        SimulatedNetwork(environment).transport("b0"),
        read_profile("native"),
        load_project(tmp_path),
        ProjectMapping(name="m", executor="reconros", software_workers=1, hardware_workers=1, callbacks={}),
        BoardOptions(),
    )


@pytest.fixture
def app(hosted: HostedBoard) -> Application:
    return hosted._application


def test_one_of_each_name(app: Application) -> None:
    for get, name in ((app.mbox, "box"), (app.mutex, "lock"), (app.cond, "changed"), (app.sem, "free")):
        assert get("os", name) is get("os", name)
    assert app.mem("os", "ram") is app.mem("os", "ram")
    assert app.cond("os", "changed").mutex is app.mutex("os", "lock")


def test_they_are_as_large_as_declared(app: Application) -> None:
    box = app.mbox("os", "box")
    assert [box.try_put(word) for word in range(3)] == [True, True, False]
    assert [app.sem("os", "free").try_wait() for _ in range(4)] == [True, True, True, False]


def test_memory_is_the_same_in_software_and_at_its_address(app: Application) -> None:
    memory = app.mem("os", "ram")
    memory.words[3] = 7
    space = app.board.memory
    assert space.read(memory.address, 64).view("<u4").tolist() == [0, 0, 0, 7] + [0] * 12
    space.write(memory.address, memory.words[3:4].view("u1").copy())
    assert memory.words[0] == 7


def test_the_client_that_is_called_is_the_source_of_responses(app: Application) -> None:
    assert app.client("ros", "ask") is app.source("ros", "ask")
    assert app.action_client("ros", "want") is app.source("ros", "want")


def test_endpoints_are_in_the_namespace_of_their_node(app: Application) -> None:
    assert app.writer("ros", "pub")._publisher.name == "/robot/out"
    assert app.client("ros", "ask")._client.name == "/robot/flip"
    app.action_client("ros", "want")
    source = app.source("ros", "act")
    source.open(lambda: None)
    app.parameters("ros", "node").declare("speed", 1)
    tokens = app.board.context.transport.tokens("@ros2_lv/**", 0)
    for name in ("%robot%serve%_action%send_goal", "%robot%want%_action%get_result"):
        assert any(f"/{name}/" in token for token in tokens)
    assert any("/%robot%arm%set_parameters/" in token for token in tokens)
    assert app.parameters("ros", "node").get("speed") == 1


@pytest.mark.parametrize("end", ["stream_in", "stream_out"])
def test_a_node_of_streams_alone_is_in_the_graph(app: Application, end: str) -> None:
    (app.source if end == "stream_in" else app.writer)("ros", end)
    (token,) = (parse(token) for token in app.board.context.transport.tokens("@ros2_lv/**", 0))
    assert isinstance(token, NodeToken)
    assert (token.namespace, token.node) == ("/robot", "arm")


def test_a_closed_board_takes_its_nodes_out_of_the_graph(hosted: HostedBoard) -> None:
    transport = hosted.board.context.transport
    hosted._application.writer("ros", "pub")
    in_domain_0 = "@ros2_lv/0/**"
    assert len(transport.tokens(in_domain_0, 0)) == 2  # the node and its publisher
    hosted.close()
    assert transport.tokens(in_domain_0, 0) == []


def test_what_a_node_sends_for_its_parameters_and_actions_is_no_message_of_a_callback(
    app: Application,
) -> None:
    app.parameters("ros", "node").declare("speed", 1)
    app.board.environment.run(until=1)
    assert app.board.spans.mean_ms().keys() == {"/robot/arm"}
    app.source("ros", "act").open(lambda: None)
    client = ActionClient(app.board.context.node("other"), _fibonacci(app), "/robot/serve", lambda _: None)
    app.board.environment.run(until=2)
    client.send_goal(_fibonacci(app).goal.cls(order=1), client.new_goal_id())
    app.board.environment.run(until=3)
    assert app.board.spans.mean_ms().keys() == {"/robot/arm", "/robot/serve"}


def _fibonacci(app: Application) -> ActionType:
    return app.types.action("example_interfaces/action/Fibonacci")


def test_the_qos_of_a_topic_is_chosen_that_of_others_is_fixed(app: Application) -> None:
    qos = QosProfile(Reliability.BEST_EFFORT, depth=1)
    source = app.source("ros", "sub", qos)
    source.open(lambda: None)
    app.writer("ros", "pub", qos)
    tokens = app.board.context.transport.tokens("@ros2_lv/**", 0)
    assert sum(token.endswith(f"/{qos.encode()}") for token in tokens) == 2
    with pytest.raises(UsageError, match="'act' of group 'ros' is a rosactions: its QoS is fixed"):
        app.source("ros", "act", qos)
    for end, name in ((app.source, "stream_in"), (app.writer, "stream_out")):
        with pytest.raises(UsageError, match="is a hardware-mapped topic: its QoS is fixed"):
            end("ros", name, qos)


def test_a_resource_of_another_type(app: Application) -> None:
    with pytest.raises(UsageError, match="'lock' of group 'os' is a mutex, not a mbox"):
        app.mbox("os", "lock")


def test_the_board_has_the_projects_clock_and_pointers(app: Application) -> None:
    assert app.board.slots[0].clock_hz == 200_000_000
    assert app.board.memory.layout.pointer.itemsize == 8
