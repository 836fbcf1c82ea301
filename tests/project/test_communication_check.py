"""Topics that cannot be mapped as the project file says are refused with file and line."""

from __future__ import annotations

import pytest

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.communication import check_fifos, check_places, check_topics
from reconros_zenoh.project.mapping_file import CallbackMapping
from reconros_zenoh.ros.type_registry import TypeRegistry

HEAD = """[HwSlot@slot(0:1)]
Id = 0
Reconfigurable = true
Region_0 = SLICE_X0Y0:SLICE_X9Y9
Region_1 = SLICE_X0Y10:SLICE_X9Y19
[ResourceGroup@g]
node = rosnode, "/n"
image = rosmsg, sensor_msgs, msg, Image
"""
THREAD = "[ReconosThread@t]\nSlot = slot(0)\nHwSource = hls\nSwSource = c\nResourceGroup = g\n"
GATEWAY = "[ROSGateway@{}]\nSlot = slot(1)\nHWTopic = {}\nSWTopic = {}\nMsgType = {}\n"


def configuration(tmp_path, text):
    path = tmp_path / "build.cfg"
    path.write_text(HEAD + text)
    return read_build_cfg(path)


HW = 'hw = rossub, node, sensor_msgs/Image, "/a", hw\n'
SW = 'sw = rossub, node, image, "/a"\n'


@pytest.mark.parametrize(
    ("text", "line", "words"),
    {
        "software subscriber, no gateway": (HW + SW, 10, "has a software-mapped subscriber but no gateway"),
        "software subscriber, gateway to another topic": (
            HW + SW + GATEWAY.format("g", "/a", "/b", "sensor_msgs/Image"),
            10,
            "has a software-mapped subscriber but no gateway to it",
        ),
        "gateway of another type": (
            HW + GATEWAY.format("g", "/a", "/b", "std_msgs/UInt32"),
            10,
            "has the type std_msgs/msg/UInt32, but hw in line 9",
        ),
        "gateway of another type than its SMT": (
            SW + GATEWAY.format("g", "/b", "/a", "std_msgs/UInt32"),
            10,
            "but sw in line 9",
        ),
        "two gateways on one pair": (
            HW
            + GATEWAY.format("g", "/a", "/b", "sensor_msgs/Image")
            + GATEWAY.format("h", "/a", "/b", "sensor_msgs/Image"),
            15,
            "/a is mapped twice",
        ),
        "one SMT for two": (
            HW
            + GATEWAY.format("g", "/a", "/b", "sensor_msgs/Image")
            + GATEWAY.format("h", "/c", "/b", "sensor_msgs/Image"),
            15,
            "/b is mapped twice",
        ),
        "message larger than its FIFO": (
            (
                'p = rospub, node, sensor_msgs/Image, "/a", hw, 1000\n'
                's = rossub, node, sensor_msgs/Image, "/a", hw, 2, drop, 999\n'
            ),
            10,
            "The FIFO of s holds messages of 999 bytes, but p (line 9) publishes up to 1000",
        ),
        "name that ROS 2 does not allow": (
            'sw = rossub, node, image, "/1a"\n',
            9,
            "'/1a' has a part that begins with a digit",
        ),
        "gateway to such a name": (
            HW + GATEWAY.format("g", "/a", "/1b", "sensor_msgs/Image"),
            10,
            "'/1b' has a part that begins with a digit",
        ),
        "gateway whose name no node can have": (
            HW + GATEWAY.format("a-b", "/a", "/b", "sensor_msgs/Image"),
            10,
            "The node name 'a-b'",
        ),
        "two types": (
            HW + 'p = rospub, node, std_msgs/UInt32, "/a", hw\n',
            10,
            "has the type std_msgs/msg/UInt32 here and sensor_msgs/msg/Image in line 9",
        ),
    }.values(),
)
def test_what_cannot_be_mapped_is_refused(tmp_path, text, line, words) -> None:
    with pytest.raises(FileError) as refused:
        check_topics(configuration(tmp_path, text))
    assert refused.value.line == line
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("end", "words"),
    {
        "rossub, node, std_msgs/UInt32, /a, hw, 2, block, 8": None,
        "rossub, node, std_msgs/UInt32, /a, hw, 2, block, 7": (
            "message_bytes of hw is 7, but no message of the type std_msgs/msg/UInt32 has fewer than 8 bytes"
        ),
        "rospub, node, std_msgs/UInt32, /a, hw, 8": None,
        "rospub, node, std_msgs/UInt32, /a, hw, 7": "message_bytes of hw is 7",
        "rossub, node, std_msgs/UInt32, /a, hw": None,
        # 4 + stamp 8, frame_id 5 (8), height and width 8, encoding 5, is_bigendian 1 (3), step 4, count 4.
        "rossub, node, sensor_msgs/Image, /a, hw, 2, drop, 44": None,
        "rossub, node, sensor_msgs/Image, /a, hw, 2, drop, 43": "fewer than 44 bytes",
        "rospub, node, std_msgs/UInt23, /a, hw, 8": "hw: ",
    }.items(),
)
def test_a_fifo_has_room_for_the_smallest_message(tmp_path, end, words) -> None:
    project = configuration(tmp_path, f"hw = {end}\n")
    if words is None:
        check_fifos(project, TypeRegistry)
        return
    with pytest.raises(FileError) as refused:
        check_fifos(project, TypeRegistry)
    assert refused.value.line == 9
    assert words in str(refused.value)


def test_a_fifo_of_the_size_of_its_messages_holds_them(tmp_path) -> None:
    check_topics(
        configuration(
            tmp_path,
            'p = rospub, node, sensor_msgs/Image, "/a", hw, 1000\n'
            's = rossub, node, sensor_msgs/Image, "/a", hw, 2, drop, 1000\n',
        )
    )


def test_a_gateway_lets_both_sides_have_the_same_name(tmp_path) -> None:
    check_topics(configuration(tmp_path, HW + SW + GATEWAY.format("g", "/a", "/a", "sensor_msgs/Image")))


def test_a_gateway_to_a_stream_without_an_end_is_a_warning(tmp_path) -> None:
    used = GATEWAY.format("g", "/a", "/b", "sensor_msgs/Image")
    read = configuration(tmp_path, HW + used)
    assert check_topics(read).warnings == read.warnings
    read = configuration(tmp_path, HW + GATEWAY.format("g", "/aa", "/b", "sensor_msgs/Image"))
    assert check_topics(read).warnings[-1] == (
        f"{tmp_path / 'build.cfg'}:10: the gateway g has no use, because nobody has a hardware-mapped end of "
        "/aa. There are ends of: /a."
    )


def test_a_callback_at_a_stream_may_only_be_mapped_to_slots(tmp_path) -> None:
    read = configuration(tmp_path, HW + THREAD)
    check_places(read, {"t": CallbackMapping(slots=(0,))})
    with pytest.raises(
        FileError, match="callback t is mapped to software, but hw is a subscriber"
    ) as refused:
        check_places(read, {"t": CallbackMapping(software=True, slots=(0,))})
    assert refused.value.line == 9


def test_a_callback_that_has_slots_and_no_software_version_stays_out_of_software(tmp_path) -> None:
    hardware_only = THREAD.replace("SwSource = c\n", "")
    read = configuration(tmp_path, hardware_only)
    check_places(read, {"t": CallbackMapping(slots=(0,))})
    with pytest.raises(FileError, match="callback t is mapped to software, but has no SwSource") as refused:
        check_places(read, {"t": CallbackMapping(software=True, slots=(0,))})
    assert refused.value.line == 9
    # One that could be nowhere else is only warned of.
    read = configuration(tmp_path, hardware_only.replace("HwSource = hls\n", ""))
    check_places(read, {"t": CallbackMapping(software=True)})


@pytest.mark.parametrize(
    ("arguments", "fifo"),
    [
        ("hw", (2, "block", None)),
        ("hw, 8", (8, "block", None)),
        ("hw, 8, drop", (8, "drop", None)),
        ("hw, 1, block, 4096", (1, "block", 4096)),
    ],
)
def test_a_subscriber_declares_its_fifo(tmp_path, arguments, fifo) -> None:
    read = configuration(tmp_path, f'hw = rossub, node, sensor_msgs/Image, "/a", {arguments}\n')
    plan = read.resources[-1].fifo
    assert (plan.depth, plan.policy, plan.message_bytes) == fifo


@pytest.mark.parametrize(
    ("end", "words"),
    [
        ("rossub, node, sensor_msgs/Image, /a, hw, 0", "depth of hw is 0"),
        ("rossub, node, sensor_msgs/Image, /a, hw, 1, wait", "'wait' about a full FIFO"),
        ("rospub, node, sensor_msgs/Image, /a, hw, drop", "message_bytes of hw is 'drop', not a number"),
        ("rospub, node, sensor_msgs/Image, /a, hw, 1, drop", "do not fit rospub"),
    ],
)
def test_a_fifo_that_cannot_be_is_refused(tmp_path, end, words) -> None:
    with pytest.raises(FileError, match=words) as refused:
        configuration(tmp_path, f"hw = {end}\n")
    assert refused.value.line == 9


def test_a_slot_that_is_not_reconfigurable_holds_one_callback(tmp_path) -> None:
    text = "[HwSlot@fixed(0:1)]\nId = 5\n"
    read = configuration(tmp_path, text)
    check_places(read, {"t": CallbackMapping(slots=(5, 0)), "u": CallbackMapping(slots=(6, 0))})
    with pytest.raises(
        FileError, match=r"fixed\(1\) \(Id 6\) is not reconfigurable, but t and u are mapped to it"
    ) as refused:
        check_places(read, {"t": CallbackMapping(slots=(6,)), "u": CallbackMapping(slots=(6, 0))})
    assert refused.value.line == 9


def test_a_gateway_shares_its_slot_with_no_callback(tmp_path) -> None:
    read = configuration(tmp_path, HW + THREAD + GATEWAY.format("g", "/a", "/a", "sensor_msgs/Image"))
    check_places(read, {"t": CallbackMapping(slots=(0,))})
    with pytest.raises(
        FileError, match=r"gateway g has no slot for itself: its Slot names only those of the callback t\."
    ) as refused:
        check_places(read, {"t": CallbackMapping(slots=(0, 1))})
    assert refused.value.line == 15


def test_a_gateway_shares_its_slot_with_no_other(tmp_path) -> None:
    gateways = GATEWAY.format("g", "/a", "/b", "sensor_msgs/Image") + GATEWAY.format(
        "h", "/c", "/d", "sensor_msgs/Image"
    )
    read = configuration(tmp_path, THREAD + gateways)
    with pytest.raises(FileError, match=r"gateway h has no slot .* only those of the gateway g") as refused:
        check_places(read, {"t": CallbackMapping(slots=(0,))})
    assert refused.value.line == 19
