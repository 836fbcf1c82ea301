"""Resources of a group: arguments, references, and the mistakes in them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.resource_groups import _ARGUMENTS, _HARDWARE_MAPPED
from reconros_zenoh.project.type_names import inline_message_type, ros_type_name

if TYPE_CHECKING:
    from reconros_zenoh.project.build_cfg import BuildConfiguration

GROUP = '[General]\nName = x\n[ResourceGroup@g]\nnode = rosnode, "/n"\nmsg = rosmsg, std_msgs, msg, UInt32\n'


def read(tmp_path: Path, text: str) -> BuildConfiguration:
    path = tmp_path / "build.cfg"
    path.write_text(text, encoding="utf-8")
    return read_build_cfg(path)


@pytest.mark.parametrize(
    ("written", "normalised"),
    [
        ("UInt32", "std_msgs/msg/UInt32"),
        ("U_Int32", "std_msgs/msg/UInt32"),
        ("U_Int32_Multi_Array", "std_msgs/msg/UInt32MultiArray"),
        ("Uint32", "std_msgs/msg/UInt32"),
        ("String", "std_msgs/msg/String"),
    ],
)
def test_type_names(written: str, normalised: str) -> None:
    assert ros_type_name("std_msgs", "msg", written) == normalised
    assert inline_message_type(f"std_msgs/{written}") == normalised
    assert inline_message_type(f"std_msgs/msg/{written}") == normalised


def test_a_type_of_another_package_keeps_its_letters() -> None:
    assert ros_type_name("my_msgs", "srv", "UintPair") == "my_msgs/srv/UintPair"


@pytest.mark.parametrize("text", ["UInt32", "std_msgs/srv/UInt32", "/UInt32", "std_msgs/"])
def test_no_inline_type(text: str) -> None:
    with pytest.raises(ValueError, match="pkg/Type"):
        inline_message_type(text)


def test_an_own_resource_comes_before_that_of_another_group(tmp_path: Path) -> None:
    configuration = read(
        tmp_path, GROUP + '[ResourceGroup@h]\nnode = rosnode, "/m"\ntmr = rostmr, node, 10\n'
    )
    assert configuration.resources[-1].node == "/m"
    assert configuration.warnings == ()


def test_a_resource_of_another_group_is_used_with_a_warning(tmp_path: Path) -> None:
    configuration = read(tmp_path, GROUP + "[ResourceGroup@h]\ntmr = rostmr, node, 10\n")
    assert configuration.resources[-1].node == "/n"
    [warning] = configuration.warnings
    assert warning.startswith(f"{tmp_path}/build.cfg:7: tmr of h uses node of the group g")


def test_a_reference_may_come_before_its_resource(tmp_path: Path) -> None:
    text = '[General]\nName = x\n[ResourceGroup@g]\ntmr = rostmr, node, 10\nnode = rosnode, "/n"\n'
    assert read(tmp_path, text).resources[0].node == "/n"


def test_percent_outside_a_range_stays(tmp_path: Path) -> None:
    text = '[General]\nName = x\n[ResourceGroup@g]\nnode_% = rosnode, "/n_%"\n'
    [node] = read(tmp_path, text).resources
    assert (node.name, node.ros_name) == ("node_%", "/n_%")


def test_percent_makes_no_second_resource_of_a_name(tmp_path: Path) -> None:
    text = '[General]\nName = x\n[ResourceGroup@g(0:1)]\nnode_1 = rosnode, "/n"\nnode_% = rosnode, "/m"\n'
    with pytest.raises(FileError, match="node_% stands for node_1 in g_1, as line 4 does") as caught:
        read(tmp_path, text)
    assert caught.value.line == 5


MISTAKES = {
    "too few arguments": ("x = rossub, node, msg", "do not fit rossub"),
    "too many arguments": ('x = rospub, node, msg, "/t", 5', "do not fit rospub"),
    "package with a slash": ("x = rosmsg, sensor/msgs, msg, Image", "do not fit rosmsg"),
    "type with a slash": ("x = rossrvmsg, std_srvs, srv, std/Empty", "do not fit rossrvmsg"),
    "kind of another type": ("x = rosmsg, std_srvs, srv, Empty", "do not fit rosmsg"),
    "open quote": ('x = rospub, node, msg, "/t', "cannot be read"),
    "quote in a word": ('x = rosnode, a"b"', "cannot be read"),
    "empty name": ('x = rosnode, ""', "cannot be read"),
    "poll interval": ('x = rossub, node, msg, "/t", soon', "poll_us of x is 'soon'"),
    "period": ("x = rostmr, node, 2.5", "period_ms of x is '2.5'"),
    "no period": ("x = rostmr, node, 0", "The period of the timer x is 0 ms"),
    "undeclared node": ("x = rostmr, nodes, 10", "no group declares one"),
    "undeclared message": ('x = rossub, node, msgs, "/t"', "the rosmsg msgs"),
    "reference of another type": ("x = rostmr, msg, 10", "msg is a rosmsg (line 5)"),
    "service without its message": ('x = rossrvs, node, msg, "/t"', "needs a rossrvmsg"),
    "undeclared mutex": ("x = cond, lock", "the mutex lock"),
    "hardware-mapped without a type": ('x = rospub, node, msg, "/t", hw', "'msg'"),
    "hardware-mapped of no node": ('x = rospub, nodes, std_msgs/UInt32, "/t", hw', "the rosnode nodes"),
    "inline type without hw": ('x = rospub, node, std_msgs/UInt32, "/t"', "the rosmsg std_msgs/UInt32"),
}


@pytest.mark.parametrize(("resource", "problem"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_reported_with_its_line(tmp_path: Path, resource: str, problem: str) -> None:
    with pytest.raises(FileError) as caught:
        read(tmp_path, f"{GROUP}{resource}\n")
    assert caught.value.line == 6
    assert problem in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize("resource", ["x = fifo, (a) b", "x ="])
def test_an_unknown_type_is_left_out_with_a_warning(tmp_path: Path, resource: str) -> None:
    configuration = read(tmp_path, f"{GROUP}{resource}\n")
    assert "x" not in [found.name for found in configuration.resources]
    [warning] = configuration.warnings
    assert warning.startswith(f"{tmp_path}/build.cfg:6: x is no known resource")
    assert warning.endswith(f". Known types: {', '.join(_ARGUMENTS)}.")


def test_an_unknown_type_that_is_nearly_one_is_told_so(tmp_path: Path) -> None:
    [warning] = read(tmp_path, f"{GROUP}x = rossubb, node, msg, /t\n").warnings
    assert warning.endswith(" left out: 'rossubb'. Did you mean rossub?")


def test_the_table_of_the_documentation_has_every_type() -> None:
    page = (Path(__file__).parents[2] / "docs" / "porting.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z]+(?:, [^`]+)?)` \|", page.replace("\\|", "|"), re.MULTILINE)
    known = [*_ARGUMENTS.items(), *_HARDWARE_MAPPED.items()]
    assert sorted(rows) == sorted(", ".join((name, *arguments)) for name, arguments in known)


def test_a_reference_goes_to_the_one_group_that_declares_the_name_with_the_right_type(tmp_path: Path) -> None:
    configuration = read(
        tmp_path,
        f"{GROUP}[ResourceGroup@k]\nnode = rosmsg, std_msgs, msg, UInt32\n"
        "[ResourceGroup@h]\ntmr = rostmr, node, 10\n",
    )
    (timer,) = [resource for resource in configuration.resources if resource.type == "rostmr"]
    assert timer.node == "/n"


def test_a_reference_to_one_of_several_groups(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="2 other groups declare one") as caught:
        read(
            tmp_path,
            '[General]\nName = x\n[ResourceGroup@g(0:1)]\nnode = rosnode, "/n%"\n'
            "[ResourceGroup@h]\ntmr = rostmr, node, 10\n",
        )
    assert caught.value.line == 6
