"""The ReconROS project file `build.cfg`: the board, its slots, and what each callback needs.

The grammar is that of ReconROS (ReconROS Executor, Section IV, Listing 1). What this project does not know
is left out with a line in `warnings`, and what is missing but not needed here is warned of, so that a file
written for the FPGA tool flow reads as it is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.project.clocks import read_clock, read_clock_name
from reconros_zenoh.project.ini import Section, read_sections, unique_names
from reconros_zenoh.project.resource_groups import read_resource_groups
from reconros_zenoh.project.slots import REGION_OPTION, read_slot_ids, read_slots
from reconros_zenoh.project.type_names import inline_message_type
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator
    from pathlib import Path

    from reconros_zenoh.project.clocks import Clock
    from reconros_zenoh.project.ini import Option
    from reconros_zenoh.project.resource_groups import Resource
    from reconros_zenoh.project.slots import HwSlot

# Of a gateway; an extension of ours.
_QOS_OPTIONS = ("Reliability", "Durability", "History", "Depth")
_KNOWN_OPTIONS = {
    "General": frozenset(
        {
            "Name",
            "TargetBoard",
            "TargetPart",
            "ReferenceDesign",
            "TargetOS",
            "TargetXil",
            "TargetHls",
            "SystemClock",
            "CFlags",
            "LdFlags",
            "Hls_CFlags",
            "PartialReconfiguration",
            "ROS2Distribution",
            "CPUArchitecture",
            "HLSMultithreading",
            "TargetBoardAddress",
            "TargetBoardUser",
            "TargetBoardPassword",
        }
    ),
    "Clock": frozenset({"ClockSource", "ClockFreq"}),
    "HwSlot": frozenset({"Id", "Clock", "Reconfigurable", "Ports"}),
    "ReconosThread": frozenset(
        {"Slot", "HwSource", "SwSource", "ResourceGroup", "UseMem", "VideoOut", "Ports"}
    ),
    "ROSGateway": frozenset({"Slot", "HWTopic", "SWTopic", "MsgType", *_QOS_OPTIONS}),
}
_KINDS = {*_KNOWN_OPTIONS, "ResourceGroup"}


@dataclass(frozen=True)
class TargetBoard:
    """The board a project is built for, as the tool flow names it; a file may give no revision."""

    board: str
    revision: str


@dataclass(frozen=True)
class ReconosThread:
    """A callback: the ids of the slots it can be built for, its sources, and the groups of its resources.

    `hardware` and `software` are the source entries (`hls`, `c`, ...), None where there is none. A thread
    uses memory and no video output unless the file says otherwise, as in the ReconOS tools.
    """

    name: str
    slots: tuple[int, ...]
    hardware: str | None
    software: str | None
    resource_groups: tuple[str, ...]
    use_mem: bool
    video_out: bool
    ports: str | None
    line: int


@dataclass(frozen=True)
class RosGateway:
    """A gateway between a hardware-mapped and a software-mapped topic.

    `slots` are the ids of the slots that it can be built for, `type` is the ROS 2 name of the message type,
    `qos` that of both its ends on the software-mapped topic.
    """

    name: str
    slots: tuple[int, ...]
    hw_topic: str
    sw_topic: str
    type: str
    qos: QosProfile
    line: int


@dataclass(frozen=True)
class BuildConfiguration:
    """Everything a project file says; `warnings` are lines `path:line: what was left out and why`.

    A file without `[General]` (the paper prints only the part on ROS 2 and slots) is named after its folder.
    `options` are the options of `[General]` as written; `repr` leaves them out, as a password can be there.
    """

    path: Path
    name: str
    board: TargetBoard | None
    part: str | None
    os: str | None
    partial_reconfiguration: bool
    ros2_distribution: str
    cpu_architecture: str
    system_clock: str | None
    options: dict[str, Option] = field(repr=False)
    clocks: tuple[Clock, ...]
    slots: tuple[HwSlot, ...]
    threads: tuple[ReconosThread, ...]
    resources: tuple[Resource, ...]
    gateways: tuple[RosGateway, ...]
    warnings: tuple[str, ...]


def read_build_cfg(path: Path) -> BuildConfiguration:
    """Return what the project file says, checked; `FileError` names the line of the first mistake."""
    warnings: list[str] = []
    sections = read_sections(path, warnings)
    if not any(section.kind in _KINDS for section in sections):
        raise FileError(
            path,
            1,
            "this is no ReconROS project file: it has no section such as [General] or [ReconosThread@name].",
            "Give a project's build.cfg; `reconros new NAME` makes a project.",
        )
    warnings += _unknown(sections)

    def of_kind(kind: str) -> list[Section]:
        return [section for section in sections if section.kind == kind]

    general = _general(path, of_kind("General"), warnings)
    partial_reconfiguration = general.boolean("PartialReconfiguration", default=False)
    clocks = [read_clock(name, section, warnings) for name, section in unique_names(of_kind("Clock"))]
    clock_names = [clock.name for clock in clocks]
    slots = read_slots(
        of_kind("HwSlot"), clock_names, warnings, partial_reconfiguration=partial_reconfiguration
    )
    groups = read_resource_groups(of_kind("ResourceGroup"), warnings)
    threads = [
        _thread(name, section, slots, groups, warnings)
        for name, section in unique_names(of_kind("ReconosThread"))
    ]
    gateways = [
        _gateway(name, section, slots, warnings) for name, section in unique_names(of_kind("ROSGateway"))
    ]
    warnings += _mismatches(slots, threads, path, partial_reconfiguration=partial_reconfiguration)
    return BuildConfiguration(
        path=path,
        name=general.value("Name") or path.absolute().parent.name,
        board=_target_board(general, warnings),
        part=general.value("TargetPart"),
        os=general.value("TargetOS"),
        partial_reconfiguration=partial_reconfiguration,
        ros2_distribution=general.value("ROS2Distribution") or "dashing",
        cpu_architecture=general.value("CPUArchitecture") or "arm32",
        system_clock=read_clock_name(general, "SystemClock", clock_names),
        options=general.options,
        clocks=tuple(clocks),
        slots=tuple(slots),
        threads=tuple(threads),
        resources=tuple(resource for resources in groups.values() for resource in resources),
        gateways=tuple(gateways),
        warnings=tuple(warnings),
    )


def _unknown(sections: Iterable[Section]) -> Iterator[str]:
    """Yield a warning for each section and option that the grammar does not have."""
    for section in sections:
        if section.kind == "ResourceGroup":  # its options are resources, under names of the user's own
            continue
        known = _KNOWN_OPTIONS.get(section.kind)
        if known is None:
            yield f"{section.path}:{section.line}: the unknown section {section} is left out."
            continue
        for option in section.options.values():
            if option.name not in known and not (
                section.kind == "HwSlot" and REGION_OPTION.fullmatch(option.name)
            ):
                yield f"{option.path}:{option.line}: the unknown option {option.name} is left out."


def _mismatches(
    slots: Iterable[HwSlot], threads: Iterable[ReconosThread], path: Path, *, partial_reconfiguration: bool
) -> Iterator[str]:
    """Yield a warning for each slot and thread that cannot do what the file seems to want of it."""
    for slot in slots:
        if slot.reconfigurable and not partial_reconfiguration:
            yield (
                f"{path}:{slot.line}: {slot.name} is Reconfigurable, but [General] does not set "
                "PartialReconfiguration = true."
            )
    for thread in threads:
        if thread.hardware is None and thread.software is None:
            yield (
                f"{path}:{thread.line}: {thread.name} has neither HwSource nor SwSource, so it can run in "
                "software only."
            )
        if thread.hardware is not None and not thread.slots:
            yield f"{path}:{thread.line}: {thread.name} has a HwSource but no Slot to be built for."


def _general(path: Path, sections: list[Section], warnings: list[str]) -> Section:
    if not sections:
        warnings.append(f"{path}:1: there is no [General]; the project is named after its folder.")
        return Section(path, 1, "General", "")
    for section in sections:
        if section.label:
            raise section.error(f"{section} cannot have a name.", "Write `[General]`.")
    if len(sections) > 1:
        raise sections[1].error(
            f"[General] stands twice, first in line {sections[0].line}.", "Put its options under one heading."
        )
    if sections[0].value("Name") is None:
        warnings.append(
            f"{path}:{sections[0].line}: [General] has no Name; the project is named after its folder."
        )
    return sections[0]


def _target_board(general: Section, warnings: list[str]) -> TargetBoard | None:
    value = general.value("TargetBoard")
    if value is None:
        return None
    option = general.required("TargetBoard")
    match re.findall(r"[^\s,]+", value):
        case [board, revision]:
            return TargetBoard(board, revision)
        case [board]:
            warnings.append(f"{option.path}:{option.line}: TargetBoard {board} has no revision.")
            return TargetBoard(board, "")
    raise option.error(
        f"TargetBoard is {value!r}, not a board and its revision.", "Write `TargetBoard = zedboard,d`."
    )


def _group_names(section: Section, groups: Collection[str]) -> tuple[str, ...]:
    option = section.options.get("ResourceGroup")
    if option is None:
        return ()
    remedy = f"Known groups: {', '.join(groups) or 'none'}."
    listed: list[str] = []
    for entry in option.numbered_names(remedy):
        listed += [entry.name] if entry.numbers is None else [f"{entry.name}_{n}" for n in entry.numbers]
    for name in listed:
        if name not in groups:
            raise option.error(f"{section} names the unknown resource group {name}.", remedy)
    return tuple(dict.fromkeys(listed))


def _thread(
    name: str,
    section: Section,
    slots: Collection[HwSlot],
    groups: Collection[str],
    warnings: list[str],
) -> ReconosThread:
    if "/" in name:
        raise section.error(
            f"{section} cannot have a `/` in its name, which is part of its bitstreams' file names.",
            "Rename it, also in main.py and the mappings.",
        )
    return ReconosThread(
        name=name,
        slots=read_slot_ids(section, slots, warnings),
        hardware=section.value("HwSource"),
        software=section.value("SwSource"),
        resource_groups=_group_names(section, groups),
        use_mem=section.boolean("UseMem", default=True),
        video_out=section.boolean("VideoOut", default=False),
        ports=section.value("Ports"),
        line=section.line,
    )


def _gateway(name: str, section: Section, slots: Collection[HwSlot], warnings: list[str]) -> RosGateway:
    section.required("Slot")
    hw_topic, sw_topic, written = (section.required(key) for key in ("HWTopic", "SWTopic", "MsgType"))
    try:
        message_type = inline_message_type(written.value)
    except ValueError as error:
        raise written.error(str(error), "Write for example `MsgType = sensor_msgs/Image`.") from None
    return RosGateway(
        name=name,
        slots=read_slot_ids(section, slots, warnings),
        hw_topic=hw_topic.value.strip('"'),
        sw_topic=sw_topic.value.strip('"'),
        type=message_type,
        qos=_qos(section),
        line=section.line,
    )


def _qos(section: Section) -> QosProfile:
    words: dict[str, str | int] = {}
    for name in _QOS_OPTIONS:
        if section.value(name) is None:
            continue
        option = section.required(name)
        words[name.lower()] = section.number(name) if name == "Depth" else option.value.lower()
        try:
            QosProfile.of_words(words)
        except UsageError as error:
            raise option.error(f"{section} cannot have this QoS:", str(error)) from None
    return QosProfile.of_words(words)
