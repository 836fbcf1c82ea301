"""Interface definitions of a project: where they lie and what is wrong in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.interfaces import Interfaces, read_interfaces

if TYPE_CHECKING:
    from pathlib import Path

MESSAGE = """\
# A comment
uint8 RED=1
string NAME = "a # b"
uint32[] data          # with a comment
float64[<=3] bounded
string<=10[4] names
geometry_msgs/Point place
Colour colour
string text "a"
int32 x 5
"""


def write(project: Path, name: str, text: str) -> Path:
    path = project / "msg" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_a_project_without_interfaces(tmp_path: Path) -> None:
    assert read_interfaces(tmp_path) == Interfaces({}, {})


def test_all_kinds_are_found_by_name(tmp_path: Path) -> None:
    paths = {
        "a_msgs/action/Go": write(
            tmp_path, "a_msgs/action/Go.action", "int32 to\n---\nbool done\n---\nint32 at\n"
        ),
        "a_msgs/msg/Thing": write(tmp_path, "a_msgs/msg/Thing.msg", MESSAGE),
        "b_msgs/srv/Empty": write(tmp_path, "b_msgs/srv/Empty.srv", "---\n"),
    }
    write(tmp_path, "a_msgs/CMakeLists.txt", "project(a_msgs)\n")
    interfaces = read_interfaces(tmp_path)
    assert interfaces.paths == paths
    assert list(interfaces.texts) == list(paths)
    assert interfaces.texts["a_msgs/msg/Thing"] == MESSAGE


def test_the_parts_of_a_service_may_share_names(tmp_path: Path) -> None:
    write(tmp_path, "a/srv/S.srv", "int32 x\n---\nint32 x\n")
    assert list(read_interfaces(tmp_path).texts) == ["a/srv/S"]


MISTAKES = {
    "no name": ("T.msg", "\nuint32\n", 2, "neither a field"),
    "unknown primitive": ("T.msg", "uint33 x\n", 1, "'uint33' is no type"),
    "bad array": ("T.msg", "uint32[n] x\n", 1, "'uint32[n]' is no type"),
    "bounded number": ("T.msg", "int32<=3 x\n", 1, "no type"),
    "three-part type": ("T.msg", "a/msg/B x\n", 1, "no type"),
    "capital field": ("T.msg", "uint32 x\nuint32 Data\n", 2, "'Data' is no name of a field"),
    "endless array": ("T.msg", "uint8 a\nuint32[" + "9" * 5000 + "] x\n", 2, "no type"),
    "double underscore": ("T.msg", "uint32 a__b\n", 1, "no name of a field"),
    "trailing underscore": ("T.msg", "uint32 a_\n", 1, "no name of a field"),
    "small constant": ("T.msg", "uint32 red=1\n", 1, "no name of a constant"),
    "constant without a value": ("T.msg", "uint32 RED=\n", 1, "no value of the constant"),
    "constant array": ("T.msg", "uint32[] RED=1\n", 1, "'uint32[]' is no type of a constant"),
    "constant of a message type": ("T.msg", "Point RED=1\n", 1, "no type of a constant"),
    "name twice": ("T.msg", "uint32 a\nint8 a\n", 2, "stands twice"),
    "separator in a message": ("T.msg", "uint32 a\n---\n", 2, "neither a field"),
    "service in one part": ("T.srv", "uint32 a\n", None, "has 0 lines '---'"),
    "service in three parts": ("T.srv", "---\n---\n", 2, "has 2 lines '---'"),
    "action in two parts": ("T.action", "---\n", None, "has 1 lines '---'"),
    "action in four parts": ("T.action", "---\n---\n---\n", 3, "has 3 lines '---'"),
}


@pytest.mark.parametrize(("name", "text", "line", "problem"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_reported_with_its_line(
    tmp_path: Path, name: str, text: str, line: int | None, problem: str
) -> None:
    path = write(tmp_path, f"a/{name.split('.')[1]}/{name}", text)
    with pytest.raises(FileError) as caught:
        read_interfaces(tmp_path)
    assert (caught.value.path, caught.value.line) == (path, line)
    assert problem in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("a/srv/T.msg", "wrong place"),
        ("T.srv", "wrong place"),
        ("a/msg/deep/T.msg", "wrong place"),
        ("A_Msgs/msg/T.msg", "package of a wrong name"),
        ("a/msg/my_type.msg", "no name of a ROS 2 type"),
        ("a/msg/U_Int.msg", "no name of a ROS 2 type"),
    ],
)
def test_a_file_with_a_wrong_place_or_name(tmp_path: Path, name: str, problem: str) -> None:
    path = write(tmp_path, name, "---\n" if name.endswith("srv") else "")
    with pytest.raises(FileError, match=problem) as caught:
        read_interfaces(tmp_path)
    assert caught.value.path == path


@pytest.mark.parametrize(
    ("name", "text", "line", "said"),
    [
        ("a/msg/T.msg", "uint8 x\nPoint p  # of whom\n", 2, "'a/msg/Point' is not known"),
        ("a/msg/T.msg", "\ngeometry_msgs/Pint[3] p\n", 2, "geometry_msgs/msg/Point"),
        ("a/srv/T.srv", "b/U x\n---\n", 1, "'b/msg/U' is not known"),
        ("a/action/T.action", "---\n---\nuint8 x\nb/U[<=4] y\n", 4, "'b/msg/U' is not known"),
        ("a/msg/T.msg", "T[] children\n", 1, "contains a/msg/T itself"),
    ],
)
def test_a_field_of_an_unknown_type(tmp_path: Path, name: str, text: str, line: int, said: str) -> None:
    path = write(tmp_path, name, text)
    with pytest.raises(FileError) as caught:
        read_interfaces(tmp_path).registry()
    assert (caught.value.path, caught.value.line) == (path, line)
    assert said in str(caught.value)


def test_all_kinds_become_types(tmp_path: Path) -> None:
    write(tmp_path, "a/msg/T.msg", "uint32 RED=1\nb/U[] us\nstd_msgs/Header header\n")
    write(tmp_path, "b/msg/U.msg", "float64[] x\n")
    write(tmp_path, "b/srv/Get.srv", "U u\n---\na/T t\n")
    write(tmp_path, "b/action/Go.action", "int32 to\n---\nU[2] us\n---\nint32 at\n")
    registry = read_interfaces(tmp_path).registry()
    assert registry.service("b/srv/Get").response.name == "b/srv/Get_Response"
    assert registry.action("b/Go").send_goal.dds_name == "b::action::dds_::Go_SendGoal_"
    u = registry.message("b/U").cls(x=np.array([1.5]))
    t = registry.message("a/T")
    header = registry.message("std_msgs/Header").cls(
        stamp=registry.message("builtin_interfaces/Time").cls(sec=1, nanosec=2), frame_id="f"
    )
    assert t.decode(b"".join(t.encode(t.cls(us=[u], header=header)))).us[0].x.tolist() == [1.5]
