"""A new project: the smallest one that shows what a project is made of, and runs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from pathlib import Path

_NAME = re.compile(r"(?!.*__)[a-z][a-z0-9_]*(?<!_)")

_FILES = {
    "build.cfg": """\
# `reconros check .` shows what this file says, `reconros run .` runs the project.
[General]
Name = NAME
TargetOS = linux
SystemClock = System
PartialReconfiguration = true

[Clock@System]
ClockSource = static
ClockFreq = 100000000

[HwSlot@slot(0:0)]
Id = 0
Clock = System
Reconfigurable = true
Region_0 = SLICE_X0Y0:SLICE_X49Y49, DSP48_X0Y0:DSP48_X1Y19, RAMB36_X0Y0:RAMB36_X1Y9

[ResourceGroup@count]
node = rosnode, "/NAME"
timer = rostmr, node, 100
count_msg = rosmsg, NAME_msgs, msg, Count
pub = rospub, node, count_msg, "/count"

[ReconosThread@count]
Slot = slot(0)
HwSource = hls
SwSource = c
ResourceGroup = count
""",
    "main.py": '''\
"""Adds the callbacks of build.cfg to the executor."""

from callbacks import Count


def main(app):
    count = Count(app.writer("count", "pub"))
    app.register("count", "timer", software=count.software, hardware=count.hardware)
    app.spin()
''',
    "callbacks.py": '''\
"""What the callbacks do, in software and in a slot."""


class Count:
    """Publishes how often its timer has expired."""

    def __init__(self, publisher):
        self.publisher = publisher
        self.count = 0

    def software(self, message, context):
        context.publish(self.publisher, self.next())

    def hardware(self, thread):
        yield from thread.get_init_data()
        yield from thread.publish(self.publisher, self.next())

    def next(self):
        self.count += 1
        return self.publisher.message(count=self.count)
''',
    "mappings/hardware.toml": """\
executor = "reconros"
software_workers = 2

[callbacks.count]
slots = [0]
""",
    "mappings/software.toml": """\
executor = "reconros"
software_workers = 2

[callbacks.count]
software = true
""",
    "msg/NAME_msgs/msg/Count.msg": "uint32 count\n",
}


def new_project(folder: Path) -> list[Path]:
    """Write a project that runs into a new folder, whose name is the project's; return its files.

    Raises UsageError for a folder that is there, and for a name that no package of ROS 2 could have.
    """
    name = folder.name
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"{name!r} cannot name a project. "
            "Use small letters, digits and single underscores, with a letter first."
        )
    if folder.exists():
        raise UsageError(f"{folder} is there already. Choose another name, or remove it.")
    paths = []
    for file, text in _FILES.items():
        path = folder / file.replace("NAME", name)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text.replace("NAME", name), encoding="utf-8")
        except OSError as error:
            raise UsageError(
                f"{path} cannot be written ({error.strerror}). Choose a folder that you may write to."
            ) from None
        paths.append(path)
    return paths
