"""Project files for tests: a camera pipeline with ends on both sides."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.project.build_cfg import BuildConfiguration, read_build_cfg

if TYPE_CHECKING:
    from pathlib import Path

# /image comes from elsewhere and has two readers in hardware, /edges has both ends there.
CAMERA = """\
# A camera pipeline.
[General]
Name = camera
CFlags = `pkg-config --cflags x` %d

[HwSlot@slot(0:4)]
Id = 0
Reconfigurable = false

[ResourceGroup@edge]
node   =  rosnode, "/edge"
image_msg = rosmsg, sensor_msgs, msg, Image
sub = rossub, node, image_msg, "/image", 1000
\tpub = rospub, node,
    # between the lines
    image_msg, "edges"

[ResourceGroup@lane]
node = rosnode, "/vision/lane"
image_msg = rosmsg, sensor_msgs, msg, Image
int_msg = rosmsg, std_msgs, msg, U_Int32
image = rossub, node, image_msg, "/image"
edges = rossub, node, image_msg, "/edges"
pub = rospub, node, int_msg, "~/found"

[ResourceGroup@viewer]
node = rosnode, "viewer"
srvmsg = rossrvmsg, std_srvs, srv, SetBool
int_msg = rosmsg, std_msgs, msg, U_Int32
srv = rossrvs, node, srvmsg, "show"
sub = rossub, node, int_msg, "/vision/lane/found"

[ReconosThread@edge]
Slot = slot(0)
HwSource = hls
ResourceGroup = edge

[ReconosThread@lane]
Slot = slot(1)
HwSource = hls
SwSource = c
ResourceGroup = lane

[ReconosThread@viewer]
SwSource = c
ResourceGroup = viewer
"""


def gateway(name: str, slot: int, hw_topic: str, sw_topic: str) -> str:
    """Return the section of a gateway for images, behind an empty line."""
    return (
        f"\n[ROSGateway@{name}]\nSlot = slot({slot})\nHWTopic = {hw_topic}\nSWTopic = {sw_topic}\n"
        "MsgType = sensor_msgs/Image\n"
    )


def write(folder: Path, text: str = CAMERA) -> Path:
    """Return the file with this text, byte for byte."""
    path = folder / "build.cfg"
    path.write_bytes(text.encode())
    return path


def read(folder: Path, text: str = CAMERA) -> BuildConfiguration:
    """Return the project file of this text."""
    return read_build_cfg(write(folder, text))
