"""The whole project file: Listing 1 of the paper, a file from the wild, and every mistake with its line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.build_cfg import BuildConfiguration, TargetBoard, read_build_cfg
from reconros_zenoh.project.regions import Region
from reconros_zenoh.ros.qos import Durability, History, QosProfile, Reliability

if TYPE_CHECKING:
    from pathlib import Path

# The facts of Listing 1, ReconROS Executor, Section IV: `@` is printed as `(at)`, the colons between the
# corners are lost, rosmsg has a second m, and lines 15 and 16 use the node of the other group.
LISTING_1 = """\
[HwSlot(at)ReconfSlot(0:0)]
Id = 0
Reconfigurable = true
Region0 = SLICE_X0Y150SLICE_X103Y199,
           DSP48_X0Y60DSP48_X7Y79,
           RAMB18_X0Y60RAMB18_X5Y79,
           RAMB36_X0Y30RAMB36_X5Y39

[ResourceGroup(at)ResourceGroupSobel]
node_2 = rosnode, "/filter"
img_msg = rosmmsg, sensor_msgs, msg, Image
sub = rossub, node_2, img_msg, "/image_raw"
pub = rospub, node_2, img_msg, "/image_filtered"

[ResourceGroup(at)ResourceGroupInverse]
node_5 = rosnode, "/inv_kinematics"
inverse_msg = rosmmsg, std_msgs, msg, Uint32
sub = rossub, node_2, inverse_msg, "/ctrl_out"
pub = rospub, node_2, inverse_msg, "/tf_out"
"""
REPAIRED_LISTING_1 = (
    LISTING_1.replace("(at)", "@")
    .replace("Region0", "Region_0")
    .replace("rosmmsg", "rosmsg")
    .replace("0SLICE", "0:SLICE")
    .replace("0DSP", "0:DSP")
    .replace("0RAMB", "0:RAMB")
)

WILD = """\
# A project as it lies about, comments and all.
[General]
Name\t=\twild
TargetBoard = zcu102 , es2
TargetPart=xczu9eg-ffvb1156-2-e
 ReferenceDesign = timer
TargetOS = linux
; another comment
TargetXil = vivado,2018.3
SystemClock = System
CFlags = -I `pkg-config --cflags x` -DRATE=50% $(shell date +%s)
\t-Wall
\t# a comment inside the value
\t-O2
PartialReconfiguration = TRUE
Mystery = 42

[Clock @ System]
ClockSource = static
ClockFreq = 100000000

[ HwSlot @ slot ( 0 : 1 ) ]
Id = 4
Clock = System
Reconfigurable = True
Ports = HDMI(in)
Region_0 = SLICE_X0Y0:SLICE_X9Y9,DSP48E2_X0Y0 : DSP48E2_X0Y3
Region_1 = SLICE_X10Y0:SLICE_X19Y9  URAM288_X0Y0:URAM288_X0Y1, CLEM_X1Y1:CLEM_X2Y2

[ResourceGroup@common]
lock = mutex
ready = cond, lock
tokens = sem 3
box = mbox, 16
scratch = mem 1024

[ResourceGroup@worker(0:1)]
node_% = rosnode "/worker_%"
flag=rosmsg\tstd_msgs, msg, U_Int32_Multi_Array
sub = rossub, node_%, flag, "/in_%", 500
direct = rospub node_%, std_msgs/U_Int32, "/direct", hw
srvmsg = rossrvmsg, example_interfaces, srv, AddTwoInts
ask = rossrvc, node_%, srvmsg, "/add"
fib = rosactionmsg, example_interfaces, action, Fibonacci
act = rosactions, node_%, fib, "/fib", 20
tick = rostmr, node_%, 40

[ReconosThread@everywhere]
Slot = slot(*)
HwSource = hls
SwSource = c
ResourceGroup = common, worker(0:1)
UseMem = false
VideoOut = true

[ReconosThread@listed]
Slot = slot(1) , slot(0)
HwSource = vhdl
ResourceGroup = worker_1

[ReconosThread@soft]
SwSource = c

[ROSGateway@bridge]
Slot = slot(0:1)
HWTopic = "/direct"
SWTopic = /direct_sw
MsgType = std_msgs/U_Int32

[Deployment@lab]
Host = `hostname`
"""


def read(tmp_path: Path, text: str) -> BuildConfiguration:
    path = tmp_path / "build.cfg"
    path.write_text(text, encoding="utf-8")
    return read_build_cfg(path)


@pytest.mark.parametrize("text", [LISTING_1, REPAIRED_LISTING_1], ids=["as printed", "repaired"])
def test_listing_1_reads(tmp_path: Path, text: str) -> None:
    configuration = read(tmp_path, text)
    [slot] = configuration.slots
    assert (slot.id, slot.name, slot.reconfigurable, slot.clock) == (0, "ReconfSlot(0)", True, None)
    assert slot.regions == (
        Region("SLICE", 0, 150, 103, 199),
        Region("DSP48", 0, 60, 7, 79),
        Region("RAMB18", 0, 60, 5, 79),
        Region("RAMB36", 0, 30, 5, 39),
    )
    resources = {(r.group, r.name): r for r in configuration.resources}
    sobel = resources["ResourceGroupSobel", "sub"]
    assert (sobel.node, sobel.interface, sobel.ros_name) == ("/filter", "sensor_msgs/msg/Image", "/image_raw")
    inverse = resources["ResourceGroupInverse", "pub"]
    assert (inverse.node, inverse.interface) == ("/filter", "std_msgs/msg/UInt32")
    message = resources["ResourceGroupInverse", "inverse_msg"]
    assert (message.type, message.args) == ("rosmsg", ("std_msgs", "msg", "Uint32"))
    assert configuration.name == tmp_path.name
    foreign = [warning for warning in configuration.warnings if "node_2" in warning]
    assert [warning.split(": ")[0] for warning in foreign] == [
        f"{tmp_path}/build.cfg:18",
        f"{tmp_path}/build.cfg:19",
    ]


def test_the_listings_differ_as_meant() -> None:
    assert REPAIRED_LISTING_1.count(":") == LISTING_1.count(":") + 4
    assert "[HwSlot@ReconfSlot(0:0)]" in REPAIRED_LISTING_1


def test_a_wild_file_reads(tmp_path: Path) -> None:
    configuration = read(tmp_path, WILD)
    assert configuration.name == "wild"
    assert configuration.board == TargetBoard("zcu102", "es2")
    assert (configuration.part, configuration.os) == ("xczu9eg-ffvb1156-2-e", "linux")
    assert configuration.partial_reconfiguration is True
    assert (configuration.ros2_distribution, configuration.cpu_architecture) == ("dashing", "arm32")
    assert configuration.options["CFlags"].value == (
        "-I `pkg-config --cflags x` -DRATE=50% $(shell date +%s)\n-Wall\n-O2"
    )
    assert configuration.options["CFlags"].value_lines == (11, 12, 14)
    assert [(c.name, c.source, c.hz, c.line) for c in configuration.clocks] == [
        ("System", "static", 100_000_000, 18)
    ]
    assert [(s.id, s.name, s.clock, s.ports) for s in configuration.slots] == [
        (4, "slot(0)", "System", "HDMI(in)"),
        (5, "slot(1)", "System", "HDMI(in)"),
    ]
    assert [r.site for r in configuration.slots[1].regions] == ["SLICE", "URAM288", "CLEM"]
    assert configuration.slots[0].regions[1] == Region("DSP48E2", 0, 0, 0, 3)
    threads = {t.name: t for t in configuration.threads}
    everywhere = threads["everywhere"]
    assert everywhere.slots == (4, 5)
    assert everywhere.resource_groups == ("common", "worker_0", "worker_1")
    assert (everywhere.hardware, everywhere.software) == ("hls", "c")
    assert (everywhere.use_mem, everywhere.video_out) == (False, True)
    assert threads["listed"].slots == (5, 4)
    assert (threads["listed"].software, threads["listed"].use_mem) == (None, True)
    assert (threads["soft"].slots, threads["soft"].hardware) == ((), None)
    [gateway] = configuration.gateways
    assert (gateway.name, gateway.slots) == ("bridge", (4, 5))
    assert (gateway.hw_topic, gateway.sw_topic) == ("/direct", "/direct_sw")
    assert gateway.type == "std_msgs/msg/UInt32"
    path = configuration.path
    assert configuration.warnings == (
        f"{path}:16: the unknown option Mystery is left out.",
        f"{path}:70: the unknown section [Deployment@lab] is left out.",
    )


def test_all_resource_types_of_the_wild_file(tmp_path: Path) -> None:
    resources = {(r.group, r.name): r for r in read(tmp_path, WILD).resources}
    assert resources["common", "lock"].args == ()
    assert resources["common", "ready"].args == ("lock",)
    numbers = {name: resources["common", name].number for name in ("tokens", "box", "scratch")}
    assert numbers == {"tokens": 3, "box": 16, "scratch": 1024}
    for number in "01":
        group = f"worker_{number}"
        assert resources[group, f"node_{number}"].ros_name == f"/worker_{number}"
        sub = resources[group, "sub"]
        assert (sub.node, sub.ros_name, sub.number) == (f"/worker_{number}", f"/in_{number}", 500)
        assert (sub.interface, sub.hardware_mapped) == ("std_msgs/msg/UInt32MultiArray", False)
        assert sub.line == 40
        direct = resources[group, "direct"]
        assert (direct.interface, direct.hardware_mapped) == ("std_msgs/msg/UInt32", True)
        assert resources[group, "ask"].interface == "example_interfaces/srv/AddTwoInts"
        assert resources[group, "ask"].number is None
        assert resources[group, "act"].interface == "example_interfaces/action/Fibonacci"
        assert resources[group, "act"].number == 20
        assert (resources[group, "tick"].node, resources[group, "tick"].number) == (f"/worker_{number}", 40)


def test_a_gateway_has_the_qos_of_its_section(tmp_path: Path) -> None:
    def qos(options: str) -> QosProfile:
        return read(tmp_path, HEAD + SLOT + GATEWAY + options).gateways[0].qos

    assert qos("") == qos("Depth =\n") == QosProfile()
    assert qos("Reliability = BEST_EFFORT\nDepth = 1\n") == QosProfile(Reliability.BEST_EFFORT, depth=1)
    assert qos("Durability = transient_local\nHistory = keep_all\n") == QosProfile(
        durability=Durability.TRANSIENT_LOCAL, history=History.KEEP_ALL
    )


def test_a_password_is_not_shown(tmp_path: Path) -> None:
    configuration = read(tmp_path, "[General]\nName = x\nTargetBoardPassword = secret\n")
    assert configuration.options["TargetBoardPassword"].value == "secret"
    assert "secret" not in repr(configuration)


def test_a_thread_without_sources_and_a_static_slot_are_warned_of(tmp_path: Path) -> None:
    text = (
        "[General]\nName = x\n[HwSlot@s(0:0)]\nId = 0\nReconfigurable = true\n"
        "[ReconosThread@t]\nSlot = s(0)\n"
    )
    warnings = read(tmp_path, text).warnings
    assert [warning.split(":")[1] for warning in warnings] == ["3", "6"]
    assert "PartialReconfiguration" in warnings[0]
    assert "neither HwSource nor SwSource" in warnings[1]


def test_slots_that_share_sites_are_warned_of(tmp_path: Path) -> None:
    configuration = read(
        tmp_path,
        "[General]\nName = x\n[HwSlot@s(0:1)]\nId = 0\nRegion_0 = DSP48_X0Y0, SLICE_X0Y0:SLICE_X3Y9\n"
        "Region_1 = DSP48_X1Y0, SLICE_X4Y0:SLICE_X7Y9\n"
        "[HwSlot@t(0:0)]\nId = 2\nRegion_0 = DSP48_X2Y0,\n  SLICE_X3Y9:SLICE_X9Y12\n",
    )
    [warning] = configuration.warnings
    assert warning == (
        f"{configuration.path}:10: SLICE_X3Y9:SLICE_X9Y12 of t(0) overlaps SLICE_X0Y0:SLICE_X3Y9 of s(0) in "
        "line 5. Give each site to one slot."
    )


@pytest.mark.parametrize("numbers", [(0, 1), (3, 4)], ids=["counted from 0", "counted as the slots"])
def test_regions_of_a_range_that_does_not_start_at_0(tmp_path: Path, numbers: tuple[int, int]) -> None:
    first, second = numbers
    slots = read(
        tmp_path,
        "[General]\nName = x\nPartialReconfiguration = true\n[HwSlot@s(3:4)]\nId = 7\nReconfigurable = true\n"
        f"Region_{first} = SLICE_X0Y0:SLICE_X1Y1\nRegion_{second} = SLICE_X2Y0:SLICE_X3Y1\n",
    ).slots
    assert [(s.id, s.name, s.regions[0].x0) for s in slots] == [(7, "s(3)", 0), (8, "s(4)", 2)]


HEAD = "[General]\nName = x\nPartialReconfiguration = true\n[Clock@c]\nClockSource = static\nClockFreq = 1\n"
SLOT = "[HwSlot@s(0:1)]\nId = 0\n"
GATEWAY = "[ROSGateway@g]\nHWTopic = a\nSWTopic = b\nMsgType = std_msgs/UInt32\nSlot = s(0)\n"

MISTAKES = {
    "text before a section": ("Name = x\n", 1, "before the first section"),
    "no form": ("[General]\nName = x\nwhat is this\n", 3, "neither a heading nor"),
    "open heading": ("[General\n", 1, "does not end with"),
    "text behind a heading": ("[General] Name = x\n", 1, "does not end with"),
    "endless range": (HEAD + "[HwSlot@s(0:999999999)]\nId = 0\n", 7, "no usable name"),
    "endless number": (HEAD + f"[HwSlot@s(0:1)]\nId = {'9' * 5000}\n", 8, "not a number"),
    "endless region": (HEAD + SLOT + f"Region_0 = SLICE_X0Y{'9' * 5000}\n", 9, "no rectangle"),
    "option twice": ("[General]\nName = x\nName = y\n", 3, "first in line 2"),
    "General twice": (HEAD + "[General]\nName = y\n", 7, "first in line 1"),
    "General with a name": ("[General@x]\nName = x\n", 1, "cannot have a name"),
    "bad board": ("[General]\nName = x\nTargetBoard = zed,board,d\n", 3, "not a board and its revision"),
    "bad boolean": ("[General]\nName = x\nPartialReconfiguration = yes\n", 3, "'yes'"),
    "unknown system clock": ("[General]\nName = x\nSystemClock = c\n", 3, "unknown clock 'c'"),
    "clock without a name": (HEAD + "[Clock]\n", 7, "no usable name"),
    "clock with a range": (HEAD + "[Clock@d(0:1)]\n", 7, "cannot have a range"),
    "clock twice": (HEAD + "[Clock@c]\n", 7, "first in line 4"),
    "clock source": (HEAD + "[Clock@d]\nClockSource = quartz\n", 8, "'quartz'"),
    "clock frequency": (HEAD + "[Clock@d]\nClockSource = static\nClockFreq = 1e8\n", 9, "not a number"),
    "clock of 0 Hz": (HEAD + "[Clock@d]\nClockSource = static\nClockFreq = 0\n", 9, "is 0"),
    "slot without a range": (HEAD + "[HwSlot@s]\nId = 0\n", 7, "no range"),
    "slot range backwards": (HEAD + "[HwSlot@s(2:0)]\nId = 0\n", 7, "no usable name"),
    "slot without Id": (HEAD + "[HwSlot@s(0:1)]\n", 7, "has no Id"),
    "slot with a bad Id": (HEAD + "[HwSlot@s(0:1)]\nId = -1\n", 8, "'-1'"),
    "slot with an unknown clock": (HEAD + SLOT + "Clock = d\n", 9, "Known clocks: c"),
    "slot ids overlap": (HEAD + SLOT + "[HwSlot@t(0:0)]\nId = 1\n", 9, "line 7 overlap"),
    "slot names overlap": (HEAD + SLOT + "[HwSlot@s(1:2)]\nId = 5\n", 9, "line 7 overlap"),
    "slot without a region": (
        HEAD + SLOT + "Reconfigurable = true\nRegion_0 = SLICE_X0Y0:SLICE_X1Y1\n",
        7,
        "s(1) has no region",
    ),
    "second region": (
        HEAD + SLOT + "Region_0 = SLICE_X0Y0:SLICE_X1Y1\nRegion0 = SLICE_X0Y0:SLICE_X1Y1\n",
        10,
        "second region",
    ),
    "region form, on its own line": (
        HEAD + SLOT + "Region_0 = SLICE_X0Y0:SLICE_X1Y1,\n  # no\n  DSP48_X0Y0:DSP48,\n",
        11,
        "'DSP48_X0Y0:DSP48'",
    ),
    "region of two sites": (HEAD + SLOT + "Region_0 = SLICE_X0Y0:DSP48_X1Y1\n", 9, "of one type"),
    "region with swapped corners": (HEAD + SLOT + "Region_0 = SLICE_X1Y0:SLICE_X0Y1\n", 9, "swapped"),
    "regions overlap": (
        HEAD + SLOT + "Region_0 = SLICE_X0Y0:SLICE_X3Y3,\n SLICE_X3Y3:SLICE_X5Y5\n",
        10,
        "overlaps",
    ),
    "group twice": (HEAD + "[ResourceGroup@g(0:1)]\n[ResourceGroup@g_1]\n", 8, "first in line 7"),
    "group without a name": (HEAD + "[ResourceGroup]\n", 7, "no usable name"),
    "thread twice": (HEAD + "[ReconosThread@t]\n[ReconosThread@t]\n", 8, "first in line 7"),
    "thread of a name that no file can have": (HEAD + "[ReconosThread@a/b]\n", 7, "a `/` in its name"),
    "thread in an unknown slot": (
        HEAD + SLOT + "[ReconosThread@t]\nSlot = s(0:2)\n",
        10,
        "unknown slot s(2)",
    ),
    "thread in a slot without number": (HEAD + SLOT + "[ReconosThread@t]\nSlot = s\n", 10, "unknown slot s"),
    "thread with a bad slot list": (HEAD + SLOT + "[ReconosThread@t]\nSlot = s(0\n", 10, "'s(0'"),
    "thread of an unknown group": (
        HEAD + "[ResourceGroup@g(0:1)]\n[ReconosThread@t]\nResourceGroup = g(0:2)\n",
        9,
        "unknown resource group g_2",
    ),
    "thread with a bad UseMem": (HEAD + "[ReconosThread@t]\nUseMem = maybe\n", 8, "'maybe'"),
    "gateway of a reliability that there is not": (
        HEAD + SLOT + GATEWAY + "Depth = 5\nReliability = somewhat\n",
        15,
        "[ROSGateway@g] cannot have this QoS: reliability is 'somewhat'. Write reliable or best_effort.",
    ),
    "gateway of a durability that there is not": (
        HEAD + SLOT + GATEWAY + "Durability = 1\n",
        14,
        "durability is '1'. Write transient_local or volatile.",
    ),
    "gateway of a history that there is not": (
        HEAD + SLOT + GATEWAY + "History = all\n",
        14,
        "history is 'all'. Write keep_last or keep_all.",
    ),
    "gateway of no depth": (HEAD + SLOT + GATEWAY + "Depth = 0\n", 14, "depth is 0. Write a number from 1"),
    "gateway of a depth in words": (HEAD + SLOT + GATEWAY + "Depth = deep\n", 14, "not a number"),
    "gateway without a slot": (HEAD + "[ROSGateway@g]\n", 7, "has no Slot"),
    "gateway in an unknown slot": (
        HEAD + SLOT + "[ROSGateway@g]\nHWTopic = a\nSWTopic = b\nMsgType = std_msgs/UInt32\nSlot = s(9)\n",
        13,
        "unknown slot s(9)",
    ),
    "gateway without a topic": (
        HEAD + SLOT + "[ROSGateway@g]\nSlot = s(0)\nHWTopic = a\n",
        9,
        "has no SWTopic",
    ),
    "gateway with a bad type": (
        HEAD + SLOT + "[ROSGateway@g]\nSlot = s(0)\nHWTopic = a\nSWTopic = b\nMsgType = UInt32\n",
        13,
        "'UInt32'",
    ),
}


@pytest.mark.parametrize(("text", "line", "problem"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_reported_with_its_line_and_a_remedy(
    tmp_path: Path, text: str, line: int, problem: str
) -> None:
    with pytest.raises(FileError) as caught:
        read(tmp_path, text)
    assert caught.value.line == line
    assert problem in str(caught.value)
    assert caught.value.remedy
    assert str(caught.value).startswith(f"{tmp_path}/build.cfg:{line}: ")


def test_the_head_of_the_mistakes_is_none(tmp_path: Path) -> None:
    assert read(tmp_path, HEAD + SLOT).warnings == ()


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be read"):
        read_build_cfg(tmp_path / "build.cfg")


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "build.cfg"
    path.write_bytes(b"[General]\nName = x\0y\n")
    with pytest.raises(FileError, match="no text") as caught:
        read_build_cfg(path)
    assert caught.value.line == 2


def test_a_byte_order_mark_and_other_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "build.cfg"
    path.write_bytes(b"\xef\xbb\xbf[General]\r\nName = x\r\n")
    assert read_build_cfg(path).name == "x"


@settings(max_examples=50)
@given(
    first=st.integers(0, 20),
    length=st.integers(1, 20),
    first_id=st.integers(0, 1000),
    pick=st.lists(st.integers(0, 19), min_size=1),
)
def test_ranges_expand_the_same_way_everywhere(
    tmp_path_factory: pytest.TempPathFactory, first: int, length: int, first_id: int, pick: list[int]
) -> None:
    last = first + length - 1
    groups = " ".join(f"g_{number}" for number in range(first, last + 1))
    picked = [first + number % length for number in pick]
    text = (
        f"[General]\nName = x\n[HwSlot@s({first}:{last})]\nId = {first_id}\n"
        f"[ResourceGroup@g({first}:{last})]\nm% = mutex\n"
        f"[ReconosThread@range]\nSlot = s({first}:{last})\nResourceGroup = g({first}:{last})\n"
        f"[ReconosThread@star]\nSlot = s(*)\nResourceGroup = {groups}\n"
        f"[ReconosThread@picked]\nSlot = {','.join(f's({n})' for n in picked)}\n"
    )
    configuration = read(tmp_path_factory.mktemp("ranges"), text)
    assert [s.name for s in configuration.slots] == [f"s({n})" for n in range(first, last + 1)]
    assert [s.id for s in configuration.slots] == list(range(first_id, first_id + length))
    assert [(r.group, r.name) for r in configuration.resources] == [
        (f"g_{n}", f"m{n}") for n in range(first, last + 1)
    ]
    by_range, by_star, by_pick = configuration.threads
    assert by_range.slots == by_star.slots == tuple(s.id for s in configuration.slots)
    assert by_range.resource_groups == by_star.resource_groups
    assert by_pick.slots == tuple(dict.fromkeys(first_id + n - first for n in picked))


@settings(max_examples=200)
@given(st.text(alphabet='[]@()=:*,%"# \tHwSlotRegionId01\n', max_size=200))
def test_any_text_reads_or_is_a_file_error(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    folder = tmp_path_factory.getbasetemp()
    line: int | None = 1
    try:
        read(folder, text)
    except FileError as error:
        line = error.line
    assert line is not None
    assert 1 <= line <= text.count("\n") + 1
