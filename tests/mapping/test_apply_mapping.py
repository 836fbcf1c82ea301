"""Writing a mapping into a project file: what has to change changes, and nothing else."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from camera_project import CAMERA, gateway, read, write

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.mapping.apply import apply_mapping
from reconros_zenoh.mapping.communication import map_topics
from reconros_zenoh.mapping.project_graph import read_project_graph
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.mapping_file import ProjectMapping

if TYPE_CHECKING:
    from pathlib import Path

CHANGED = {
    'sub = rossub, node, image_msg, "/image", 1000': 'sub = rossub, node, sensor_msgs/Image, "/image", hw',
    "\tpub = rospub, node,\n": '\tpub = rospub, node, sensor_msgs/Image, "edges", hw\n',
    '    image_msg, "edges"\n': "",
    'image = rossub, node, image_msg, "/image"': 'image = rossub, node, sensor_msgs/Image, "/image", hw',
    'edges = rossub, node, image_msg, "/edges"': 'edges = rossub, node, sensor_msgs/Image, "/edges", hw',
}
APPLIED = CAMERA + gateway("image", 2, "/image", "/image")
for before, after in CHANGED.items():
    assert before in APPLIED
    APPLIED = APPLIED.replace(before, after)


def apply_rule(path: Path) -> list[str]:
    configuration = read_build_cfg(path)
    mapping = ProjectMapping.default(configuration)
    decisions = map_topics(read_project_graph(configuration, mapping))
    return apply_mapping(configuration, mapping, {name: each.mapping for name, each in decisions.items()})


def line_of(text: str, words: str) -> int:
    return text[: text.index(words)].count("\n") + 1


def test_only_what_has_to_change_changes(tmp_path: Path) -> None:
    path = write(tmp_path)
    path.chmod(0o640)
    changes = apply_rule(path)
    assert path.read_text(encoding="utf-8") == APPLIED
    assert path.stat().st_mode & 0o777 == 0o640
    assert changes[0] == (
        f'line {line_of(CAMERA, "sub = ")}: sub = rossub, node, sensor_msgs/Image, "/image", hw'
    )
    assert len(changes) == 5
    assert "[ROSGateway@image], Slot = slot(2)" in changes[-1]
    assert [child.name for child in tmp_path.iterdir()] == ["build.cfg"]


def test_what_was_written_is_what_was_meant(tmp_path: Path) -> None:
    before = read(tmp_path)
    graph = read_project_graph(before, ProjectMapping.default(before))
    apply_rule(before.path)
    after = read_build_cfg(before.path)
    assert read_project_graph(after, ProjectMapping.default(after)) == graph
    assert {(r.group, r.name) for r in after.resources if r.hardware_mapped} == {
        ("edge", "sub"),
        ("edge", "pub"),
        ("lane", "image"),
        ("lane", "edges"),
    }
    (gateway,) = after.gateways
    assert (gateway.hw_topic, gateway.sw_topic, gateway.type) == ("/image", "/image", "sensor_msgs/msg/Image")
    assert gateway.slots == (2,)


def test_a_second_time_changes_nothing(tmp_path: Path) -> None:
    path = write(tmp_path)
    apply_rule(path)
    before = path.stat()
    assert apply_rule(path) == []
    assert path.read_text(encoding="utf-8") == APPLIED
    assert path.stat().st_ino == before.st_ino


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_line_ends_stay_as_they_are(tmp_path: Path, end: str) -> None:
    path = write(tmp_path, CAMERA.replace("\n", end))
    apply_rule(path)
    assert path.read_bytes().decode() == APPLIED.replace("\n", end)


def test_a_file_in_windows_1252_stays_in_it(tmp_path: Path) -> None:
    def old(text: str) -> bytes:
        # The byte 81 is no character; it was one in DOS.
        return re.sub(r"\bnode\b", "nœud", text).encode("cp1252").replace(b"# A", b"# F\x81r die")

    path = tmp_path / "build.cfg"
    path.write_bytes(old(CAMERA))
    apply_rule(path)
    assert path.read_bytes() == old(APPLIED)


def test_a_name_that_is_in_no_encoding_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "build.cfg"
    before = re.sub(r"\bnode\b", "n_de", CAMERA).encode().replace(b"n_de", b"n\x81de")
    path.write_bytes(before)
    with pytest.raises(UsageError, match="cannot be written in cp1252"):
        apply_rule(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (
            'image   =   rossub,node ,  image_msg,\t"/image"   # the picture\n',
            'image   =   rossub, node, sensor_msgs/Image, "/image", hw   # the picture\n',
        ),
        (
            'image: rossub, node, image_msg, "/image"\n',
            'image: rossub, node, sensor_msgs/Image, "/image", hw\n',
        ),
        (
            'image =\n  rossub, node, # whose\n  image_msg, ; what\n  "/image"\n',
            'image =\n  rossub, node, sensor_msgs/Image, "/image", hw # whose\n   ; what\n',
        ),
    ],
    ids=["odd spacing", "a colon", "several lines"],
)
def test_of_a_line_that_changes_only_the_value_changes(tmp_path: Path, before: str, after: str) -> None:
    line = 'image = rossub, node, image_msg, "/image"\n'
    path = write(tmp_path, CAMERA.replace(line, before))
    apply_rule(path)
    assert path.read_text(encoding="utf-8") == APPLIED.replace(CHANGED[line.strip()] + "\n", after)
    assert apply_rule(path) == []


def test_a_file_without_a_last_line_end(tmp_path: Path) -> None:
    path = write(tmp_path, CAMERA.rstrip("\n"))
    apply_rule(path)
    assert path.read_text(encoding="utf-8") == APPLIED


def test_a_link_to_the_file_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    target = write(tmp_path / "real")
    link = tmp_path / "build.cfg"
    link.symlink_to(target)
    apply_rule(link)
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == APPLIED


def test_a_gateway_that_is_there_gives_its_stream_to_new_readers(tmp_path: Path) -> None:
    path = write(tmp_path, CAMERA + gateway("camera", 3, "/stream", "/image"))
    apply_rule(path)
    after = read_build_cfg(path)
    assert [gateway.name for gateway in after.gateways] == ["camera"]
    assert 'image = rossub, node, sensor_msgs/Image, "/stream", hw' in path.read_text(encoding="utf-8")
    assert apply_rule(path) == []


def test_a_name_that_a_gateway_has_already_gets_a_number(tmp_path: Path) -> None:
    present = (
        "\n[ROSGateway@image]\nSlot = slot(3)\nHWTopic = /a\nSWTopic = /b\nMsgType = sensor_msgs/Image\n"
    )
    path = write(tmp_path, CAMERA + present)
    apply_rule(path)
    assert [gateway.name for gateway in read_build_cfg(path).gateways] == ["image", "image_2"]


def test_a_static_slot_is_taken_before_one_that_is_reconfigured(tmp_path: Path) -> None:
    slots = (
        "[HwSlot@slot(0:2)]\nId = 0\nReconfigurable = true\n\n"
        "[HwSlot@static(0:0)]\nId = 3\nReconfigurable = false\n"
    )
    path = write(tmp_path, CAMERA.replace("[HwSlot@slot(0:4)]\nId = 0\nReconfigurable = false\n", slots))
    apply_rule(path)
    assert read_build_cfg(path).gateways[0].slots == (3,)


REFUSED = {
    "no slot left": (("slot(0:4)", "slot(0:1)"), "/image", "no slot is left for the gateway of /image"),
    "two types on a topic": (
        ('edges = rossub, node, image_msg, "/edges"', 'edges = rossub, node, int_msg, "/edges"'),
        "edges = rossub",
        "/edges is of type std_msgs/msg/UInt32 here, of sensor_msgs/msg/Image in line",
    ),
    "one group on both sides": (
        ("ResourceGroup = viewer", "ResourceGroup = viewer, edge"),
        "sub = rossub",
        "sub is used by threads on both sides",
    ),
}


@pytest.mark.parametrize(("change", "place", "says"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_written_leaves_the_file_alone(
    tmp_path: Path, change: tuple[str, str], place: str, says: str
) -> None:
    text = CAMERA.replace(*change)
    path = write(tmp_path, text)
    with pytest.raises(FileError) as caught:
        apply_rule(path)
    assert says in str(caught.value)
    assert caught.value.line == line_of(text, place)
    assert path.read_text(encoding="utf-8") == text


NUMBERED = """\
[General]
Name = numbered

[HwSlot@slot(0:5)]
Id = 0

[ResourceGroup@reader(0:1)]
node = rosnode, "/reader%"
msg = rosmsg, std_msgs, msg, UInt32
sub = rossub, node, msg, "TOPIC"

[ReconosThread@reader0]
Slot = slot(0)
HwSource = hls
ResourceGroup = reader_0

[ReconosThread@reader1]
Slot = slot(1)
HwSource = hls
ResourceGroup = reader_1
"""


def test_a_line_of_a_numbered_group_stands_for_all_of_them(tmp_path: Path) -> None:
    path = write(tmp_path, NUMBERED.replace("TOPIC", "/in"))
    apply_rule(path)
    assert [r.hardware_mapped for r in read_build_cfg(path).resources if r.type == "rossub"] == [True, True]


def test_a_line_of_a_numbered_group_that_would_change_for_some_is_refused(tmp_path: Path) -> None:
    # Topic /in1 has a second reader in hardware and gets a gateway, /in0 does not.
    second = (
        '\n[ResourceGroup@more]\nnode = rosnode, "/more"\nmsg = rosmsg, std_msgs, msg, UInt32\n'
        'sub = rossub, node, msg, "/in1"\n\n'
        "[ReconosThread@more]\nSlot = slot(2)\nHwSource = hls\nResourceGroup = more\n"
    )
    text = NUMBERED.replace("TOPIC", "/in%") + second
    path = write(tmp_path, text)
    with pytest.raises(FileError, match="sub stands for 2 resources that do not change alike") as caught:
        apply_rule(path)
    assert caught.value.line == line_of(text, "sub = ")
