"""Writing a communication mapping into the project file: hardware-mapped topics and gateways."""

from __future__ import annotations

import re
import shutil
from collections import defaultdict
from io import StringIO
from itertools import count
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.mapping.communication import TopicMapping, topics_of
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.mapping.project_graph import TopicEnd, gateway_topics, topic_ends
from reconros_zenoh.project.ini import read_sections
from reconros_zenoh.text_file import read_old_bytes, replacing

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from reconros_zenoh.project.build_cfg import BuildConfiguration
    from reconros_zenoh.project.ini import Option
    from reconros_zenoh.project.mapping_file import ProjectMapping

_UNREADABLE = re.compile("[\udc80-\udcff]")
_WORD = re.compile(r'"[^"\n]*"|[^\s,"]+')


def apply_mapping(
    configuration: BuildConfiguration, node_mapping: ProjectMapping, mappings: Mapping[str, TopicMapping]
) -> list[str]:
    """Write the mapping of topics into the project file; return what was changed, nothing if all is there.

    The ends in hardware of topics in T_HW and T_GW become hardware-mapped, and each topic in T_GW gets a
    gateway, in a slot that no thread and no other gateway names. Every other byte of the file stays, comments
    and encoding included, and what is hardware-mapped already. The file is replaced as a whole or not at all.
    FileError names the line of what cannot be changed.
    """
    path = configuration.path
    ends = [
        end
        for end in topic_ends(configuration, node_mapping)
        if mappings[end.topic] is not TopicMapping.SOFTWARE
    ]
    _check_types(path, ends)
    content, encoding = read_old_bytes(path, [])
    lines = list(StringIO(content.decode(encoding, "surrogateescape"), newline=""))  # line ends as they are
    changes = []
    for option, value in _switched(configuration, ends):
        _write_value(lines, option, value)
        changes.append(f"line {option.line}: {option.name} = {value}")
    for section in _gateways(configuration, ends, topics_of(mappings, TopicMapping.GATEWAY)):
        if not _line_end(lines[-1]):
            lines.append(_line_end(lines[0]))
        lines += [f"{line}{_line_end(lines[0])}" for line in ("", *section)]
        changes.append(f"added: {', '.join(section)}")
    if changes:
        _replace(path.resolve(), "".join(lines), encoding)
    return changes


def kept_streams(
    configuration: BuildConfiguration, node_mapping: ProjectMapping, mappings: Mapping[str, TopicMapping]
) -> list[str]:
    """Return a sentence for each topic in T_SW that the project file maps to hardware: it stays so."""
    lines: dict[str, int] = {}
    for end in topic_ends(configuration, node_mapping):
        if end.resource.hardware_mapped and mappings[end.topic] is TopicMapping.SOFTWARE:
            lines.setdefault(end.topic, end.resource.line)
    return [
        f"{configuration.path}:{line}: {topic} stays hardware-mapped, as --apply takes nothing back. Write "
        "its ends without `hw` and remove its gateway, if it is to be software-mapped."
        for topic, line in lines.items()
    ]


def _write_value(lines: list[str], option: Option, value: str) -> None:
    """Write `value` in place of the option's, and nothing else: comments behind it stay.

    A line in which nothing is left is taken out.
    """
    for number, text in zip(option.value_lines, option.value.split("\n"), strict=True):
        line = lines[number - 1]
        read = _UNREADABLE.sub("\ufffd", line)  # as the reader of sections has it
        start = read.index(text, read.index(option.name) + len(option.name) if number == option.line else 0)
        line = f"{line[:start]}{value}{line[start + len(text) :]}"
        lines[number - 1] = line if line.strip() else ""
        value = ""


def _check_types(path: Path, ends: Iterable[TopicEnd]) -> None:
    first: dict[str, TopicEnd] = {}
    for end in ends:
        other = first.setdefault(end.topic, end).resource
        if end.resource.interface != other.interface:
            raise FileError(
                path,
                end.resource.line,
                f"{end.topic} is of type {end.resource.interface} here, of {other.interface} in line "
                f"{other.line}.",
                "Give both the same type.",
            )


def _switched(configuration: BuildConfiguration, ends: Iterable[TopicEnd]) -> Iterator[tuple[Option, str]]:
    """Yield each option that has to become hardware-mapped, with its new value.

    A numbered group makes several resources out of one line; all of them change or none.
    """
    path = configuration.path
    options = {
        option.line: option for section in read_sections(path, []) for option in section.options.values()
    }
    resources_in = [resource.line for resource in configuration.resources]
    streams = {software: hardware for hardware, software in gateway_topics(configuration).items()}
    by_line: defaultdict[int, list[TopicEnd]] = defaultdict(list)
    for end in ends:
        if Side.HARDWARE in end.sides and not end.resource.hardware_mapped:
            by_line[end.resource.line].append(end)
    for line, group in by_line.items():
        option, end = options[line], group[0]
        renamed = streams.get(end.topic, end.topic) != end.topic
        if any(Side.SOFTWARE in each.sides for each in group):
            raise option.error(
                f"{option.name} is used by threads on both sides; an HMT is for those in hardware only.",
                "Give them resource groups of their own.",
            )
        if len(group) < resources_in.count(line) or (renamed and len(group) > 1):
            raise option.error(
                f"{option.name} stands for {resources_in.count(line)} resources that do not change alike.",
                "Write the groups of the range out.",
            )
        resource_type, node, _, topic, *_ = _WORD.findall(option.value)
        topic = f'"{streams[end.topic]}"' if renamed else topic
        yield option, f"{resource_type}, {node}, {_short_type(end)}, {topic}, hw"


def _gateways(
    configuration: BuildConfiguration, ends: Iterable[TopicEnd], topics: Iterable[str]
) -> Iterator[tuple[str, ...]]:
    """Yield the lines of a section for each of the topics that has no gateway."""
    types = {end.topic: end for end in reversed(list(ends))}
    used = {slot for thread in configuration.threads if thread.hardware for slot in thread.slots}
    used |= {slot for gateway in configuration.gateways for slot in gateway.slots}
    # A gateway is always needed: a slot that is never reconfigured suits it best.
    free = sorted(
        (slot for slot in configuration.slots if slot.id not in used), key=lambda slot: slot.reconfigurable
    )
    names = {gateway.name for gateway in configuration.gateways}
    present = gateway_topics(configuration).values()
    for topic in topics:
        if topic in present:
            continue
        end = types[topic]
        if not free:
            raise FileError(
                configuration.path,
                end.resource.line,
                f"no slot is left for the gateway of {topic}: each has a thread or a gateway.",
                "Add one to a [HwSlot@name(a:b)].",
            )
        stem = topic.strip("/").replace("/", "_")
        name = next(
            name for number in count(1) if (name := stem if number == 1 else f"{stem}_{number}") not in names
        )
        names.add(name)
        yield (
            f"[ROSGateway@{name}]",
            f"Slot = {free.pop(0).name}",
            f"HWTopic = {topic}",
            f"SWTopic = {topic}",
            f"MsgType = {_short_type(end)}",
        )


def _short_type(end: TopicEnd) -> str:
    assert end.resource.interface is not None
    return end.resource.interface.replace("/msg/", "/")


def _line_end(line: str) -> str:
    return line[len(line.rstrip("\r\n")) :]


def _replace(path: Path, text: str, encoding: str) -> None:
    try:
        with replacing(path) as partial:
            partial.write_text(text, encoding=encoding, errors="surrogateescape", newline="")
            shutil.copymode(path, partial)
    except UnicodeEncodeError as error:
        raise UsageError(
            f"{path}: {error.object[error.start]!r} cannot be written in {encoding}. Save the file as UTF-8."
        ) from None
    except OSError as error:
        raise UsageError(f"{path} cannot be written ({error.strerror}). Check its permissions.") from None
