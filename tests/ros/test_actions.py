"""Action types, and the standard interfaces that rosbags does not bring."""

from __future__ import annotations

import numpy as np
import pytest
from ros2_pyterfaces.core import all_srvs, description

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.ros.standard import standard_interfaces
from reconros_zenoh.ros.type_registry import TypeRegistry

FIBONACCI = "int32 order\n---\nint32[] sequence\n---\nint32[] partial_sequence\n"


@pytest.fixture
def registry() -> TypeRegistry:
    return TypeRegistry()


def test_the_hashes_that_rosidl_generated(registry: TypeRegistry) -> None:
    # From the C code that rosidl_generator_c of ROS 2 Jazzy made of this file: the repository
    # kuldipbirhade/3DOF_manipulator_with_ROS, fibonacci__description.c of myroboticarm_msgs.
    registry.add("myroboticarm_msgs/action/Fibonacci", FIBONACCI)
    action = registry.action("myroboticarm_msgs/action/Fibonacci")
    assert {
        "action": action.type_hash,
        "goal": action.goal.type_hash,
        "result": action.result.type_hash,
        "feedback": action.feedback.type_hash,
        "send_goal": action.send_goal.type_hash,
        "send_goal request": action.send_goal.request.type_hash,
        "send_goal response": action.send_goal.response.type_hash,
        "get_result": action.get_result.type_hash,
        "get_result request": action.get_result.request.type_hash,
        "get_result response": action.get_result.response.type_hash,
        "feedback_message": action.feedback_message.type_hash,
        "UUID": registry.message("unique_identifier_msgs/UUID").type_hash,
    } == {
        "action": "RIHS01_baff49454958880a41293c548de416870fbb9d8abb27c8003260c721f713a24e",
        "goal": "RIHS01_0da682feccd6e1cae6098d44da66a43174e1feafbe6f7b096422f75838cfb6b7",
        "result": "RIHS01_c9021b4e49202b00549de48feaedb1317f356e5902b733a966404b4c5f5286a9",
        "feedback": "RIHS01_5bec308d18bf221fa9b075aca9f2d9b8787fed79a0ea3e4b64ca2577d1d68261",
        "send_goal": "RIHS01_f20274642c68c8129a7cfd872cba5837339bfab9f00d9a9d5ddb96d0925dafa7",
        "send_goal request": "RIHS01_94f8edd47fcf07c89ad88b5217480b3f083a4edd46104e0bb3e90452e52fc213",
        "send_goal response": "RIHS01_310f0e7813434b816c037b4d67eb4e1aebf7bc9c0cca4bb2f74df93740f37085",
        "get_result": "RIHS01_2873aeee2f19018ab084c7cd5625912fa3eb0d92a85ba2646757819d4e774888",
        "get_result request": "RIHS01_81f86d0b1a604de4d03901f8737713400e602fada94dda846da661a188c54761",
        "get_result response": "RIHS01_1eb3e935f928ad7d4405aff7e8dc09d407d6d36256a6e8e2ba39906fe02ab793",
        "feedback_message": "RIHS01_04a77bbfd082fb70b61325db4d33ed3962be850af4a43897567388754343c865",
        "UUID": "RIHS01_1b8e8aca958cbea28fe6ef60bf6c19b683c97a9ef60bb34752067d0f2f7ab437",
    }


def test_the_hashes_that_ros2_clients_expect(registry: TypeRegistry) -> None:
    # From the golden tests of the Swift client SwiftROS2, ActionWireTests.swift.
    action = registry.action("example_interfaces/action/Fibonacci")
    assert action.send_goal.request.type_hash == (
        "RIHS01_3d088942b413247db536576f0286768c6be8fcd5d0c9a5d544f359fba090a238"
    )
    assert action.get_result.request.type_hash == (
        "RIHS01_c8a4f5e7d13b81286ee1043e2ecd084281cecf1ff06aaa799464f5f15479f003"
    )
    assert action.feedback_message.type_hash == (
        "RIHS01_c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2"
    )
    assert action.cancel_goal.request.type_hash == (
        "RIHS01_3d3c84653c1f96918086887e1dcb236faec88b81a5b14fd4cf4840065bcdf8af"
    )
    assert action.status.type_hash == (
        "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e"
    )


def test_the_names_on_the_wire(registry: TypeRegistry) -> None:
    action = registry.action("example_interfaces/Fibonacci")
    assert action.send_goal.dds_name == "example_interfaces::action::dds_::Fibonacci_SendGoal_"
    assert action.get_result.dds_name == "example_interfaces::action::dds_::Fibonacci_GetResult_"
    assert action.feedback_message.dds_name == (
        "example_interfaces::action::dds_::Fibonacci_FeedbackMessage_"
    )
    assert action.cancel_goal.dds_name == "action_msgs::srv::dds_::CancelGoal_"
    assert action.status.dds_name == "action_msgs::msg::dds_::GoalStatusArray_"


def test_goals_and_feedback_go_over_the_wire(registry: TypeRegistry) -> None:
    action = registry.action("example_interfaces/action/Fibonacci")
    goal_id = registry.message("unique_identifier_msgs/UUID").cls(uuid=np.arange(16, dtype=np.uint8))
    request = action.send_goal.request.cls(goal_id=goal_id, goal=action.goal.cls(order=5))
    encoded = b"".join(action.send_goal.request.encode(request))
    assert encoded == bytes.fromhex("00010000") + bytes(range(16)) + bytes.fromhex("05000000")
    assert action.send_goal.request.decode(encoded).goal.order == 5
    feedback = action.feedback_message.cls(
        goal_id=goal_id, feedback=action.feedback.cls(sequence=np.array([0, 1, 1], np.int32))
    )
    decoded = action.feedback_message.decode(b"".join(action.feedback_message.encode(feedback)))
    assert decoded.feedback.sequence.tolist() == [0, 1, 1]


@pytest.mark.parametrize(
    "spelling",
    ["tf2_msgs/action/LookupTransform", "tf2_msgs/LookupTransform", "tf2_msgs/Lookup_Transform"],
)
def test_spellings_of_an_action(registry: TypeRegistry, spelling: str) -> None:
    found = registry.action(spelling)
    assert found.name == "tf2_msgs/action/LookupTransform"
    assert found is registry.action("tf2_msgs/action/LookupTransform")


def test_the_standard_services_have_the_hashes_of_ros2_pyterfaces(registry: TypeRegistry) -> None:
    theirs = {
        schema["__typename"]: description.hash_rihs01(schema)
        for schema in vars(all_srvs).values()
        if isinstance(schema, dict) and "request_message" in schema
    }
    assert len(theirs) == 27
    assert {name: registry.service(name).type_hash for name in theirs} == theirs


def test_every_standard_interface_can_be_used(registry: TypeRegistry) -> None:
    find = {"msg": registry.message, "srv": registry.service, "action": registry.action}
    names = standard_interfaces()
    assert len(names) > 60
    for name in names:
        assert find[name.split("/")[1]](name).name == name


def test_a_standard_message_is_like_its_sibling(registry: TypeRegistry) -> None:
    array = registry.message("example_interfaces/U_Int32_Multi_Array")
    layout = registry.message("example_interfaces/msg/MultiArrayLayout").cls(dim=[], data_offset=0)
    message = array.cls(layout=layout, data=np.array([7], np.uint32))
    assert array.decode(b"".join(array.encode(message))).data.tolist() == [7]


def test_an_action_is_neither_a_message_nor_a_service(registry: TypeRegistry) -> None:
    registry.add_action("lab_msgs/action/Go", FIBONACCI)
    with pytest.raises(UsageError, match="is not known"):
        registry.message("lab_msgs/action/Go")
    with pytest.raises(UsageError, match="is not known"):
        registry.service("lab_msgs/action/Go")
    with pytest.raises(UsageError, match=r"similar are lab_msgs/action/Go.* give its \.action file"):
        registry.action("lab_msgs/action/Got")


@pytest.mark.parametrize(("text", "line"), [("int32 a\n---\nint32 b\n", None), ("---\n---\n---\n", 3)])
def test_an_action_has_two_separators(registry: TypeRegistry, text: str, line: int | None) -> None:
    with pytest.raises(FileError, match="exactly 2") as caught:
        registry.add_action("lab_msgs/action/Go", text)
    assert caught.value.line == line


@pytest.mark.parametrize("text", ["uint8 a\nwstring b", "uint8 a\nwstring<=4[] b", "uint8 a\nwstring B=x"])
def test_wide_strings_are_refused(registry: TypeRegistry, text: str) -> None:
    with pytest.raises(FileError, match="wstring is not supported") as caught:
        registry.add_message("lab_msgs/msg/Wide", text)
    assert caught.value.line == 2
