"""`reconros check`: what a ReconROS project file says."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconros_zenoh.cli.console import PlainConsole, print_rows
from reconros_zenoh.cli.options import AsJson
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.communication import check_topics, check_types
from reconros_zenoh.project.loader import read_project
from reconros_zenoh.project.resources import resources_by_slot

if TYPE_CHECKING:
    from reconros_zenoh.project.build_cfg import BuildConfiguration

_ENDPOINTS = {
    "topics": ("rossub", "rospub"),
    "services": ("rossrvs", "rossrvc"),
    "actions": ("rosactions", "rosactionc"),
}
_ROLES = {
    "rossub": "subscribes",
    "rospub": "publishes",
    "rossrvs": "serves",
    "rossrvc": "calls",
    "rosactions": "serves",
    "rosactionc": "calls",
}


def check(
    project: Annotated[Path, typer.Argument(metavar="build.cfg|PROJECT", help="A project file or folder.")],
    as_json: AsJson = False,
) -> None:
    """Show what a ReconROS project file says.

    What a folder holds in msg/ and mappings/ is read too. Exit status 2 when the project cannot be used under
    each of its mappings, or without any under its default.
    """
    if project.is_dir():
        files = read_project(project)
        with files.with_its_causes():
            check_types(files.configuration, files.types())
            for refused in files.unusable_mappings().values():
                raise refused
        configuration = files.configuration
    else:
        configuration = check_topics(read_build_cfg(project))
    if as_json:
        print(json.dumps(_as_json(configuration)))
        return
    # What is read by another program must not have its names broken into lines.
    width = None if sys.stdout.isatty() else 200
    console = PlainConsole(width=width, highlight=False, soft_wrap=True)
    _print(console, configuration)
    for warning in configuration.warnings:
        console.print(f"warning: {warning}", style="yellow")


def _as_json(configuration: BuildConfiguration) -> dict[str, Any]:
    return {
        "name": configuration.name,
        "board": _board(configuration),
        "part": configuration.part,
        "os": configuration.os,
        "partial_reconfiguration": configuration.partial_reconfiguration,
        "ros2_distribution": configuration.ros2_distribution,
        "clocks": [
            {"name": clock.name, "source": clock.source, "hz": clock.hz} for clock in configuration.clocks
        ],
        "slots": _slots(configuration),
        "threads": [
            {
                "name": thread.name,
                "slots": thread.slots,
                "hardware": thread.hardware,
                "software": thread.software,
                "resource_groups": thread.resource_groups,
            }
            for thread in configuration.threads
        ],
        "resources": [
            {"group": resource.group, "name": resource.name, "type": resource.type, "args": resource.args}
            for resource in configuration.resources
        ],
        "gateways": [
            {
                "name": gateway.name,
                "slots": gateway.slots,
                "hw_topic": gateway.hw_topic,
                "sw_topic": gateway.sw_topic,
                "type": gateway.type,
            }
            for gateway in configuration.gateways
        ],
        "warnings": configuration.warnings,
    }


def _board(configuration: BuildConfiguration) -> str | None:
    """Return the board as TargetBoard writes it: `zedboard,d`."""
    board = configuration.board
    return None if board is None else f"{board.board},{board.revision}".rstrip(",")


def _slots(configuration: BuildConfiguration) -> list[dict[str, Any]]:
    resources = resources_by_slot(configuration.slots)
    return [
        {
            "id": slot.id,
            "name": slot.name,
            "clock": slot.clock,
            "reconfigurable": slot.reconfigurable,
            **asdict(resources[slot.id]),
        }
        for slot in configuration.slots
    ]


def _print(console: PlainConsole, configuration: BuildConfiguration) -> None:
    facts = {
        "board": _board(configuration),
        "part": configuration.part,
        "os": configuration.os,
        "ROS 2": configuration.ros2_distribution,
        "partial reconfiguration": "yes" if configuration.partial_reconfiguration else "no",
    }
    console.print(configuration.name, style="bold")
    console.print(", ".join(f"{name} {fact}" for name, fact in facts.items() if fact))
    console.print()
    names = {slot.id: slot.name for slot in configuration.slots}
    print_rows(
        console,
        ("name", "source", "Hz"),
        ((clock.name, clock.source, clock.hz) for clock in configuration.clocks),
        title="clocks",
    )
    print_rows(
        console,
        ("id", "name", "clock", "reconfigurable", "LUT", "DSP", "BRAM36", "BRAM18"),
        (
            ["yes" if value is True else "no" if value is False else value for value in slot.values()]
            for slot in _slots(configuration)
        ),
        title="slots",
    )
    print_rows(
        console,
        ("name", "slots", "hardware", "software", "resource groups"),
        (
            (
                thread.name,
                " ".join(names[slot] for slot in thread.slots),
                thread.hardware,
                thread.software,
                " ".join(thread.resource_groups),
            )
            for thread in configuration.threads
        ),
        title="threads",
    )
    _print_resources(console, configuration)
    print_rows(
        console,
        ("name", "slots", "hardware-mapped", "software-mapped", "type", "QoS"),
        (
            (
                gateway.name,
                " ".join(names[slot] for slot in gateway.slots),
                gateway.hw_topic,
                gateway.sw_topic,
                gateway.type,
                " ".join(map(str, gateway.qos.words().values())),
            )
            for gateway in configuration.gateways
        ),
        title="gateways",
    )


def _print_resources(console: PlainConsole, configuration: BuildConfiguration) -> None:
    resources = configuration.resources
    nodes = (resource for resource in resources if resource.type == "rosnode")
    print_rows(console, ("node", "group"), ((node.ros_name, node.group) for node in nodes), title="nodes")
    for title, types in _ENDPOINTS.items():
        print_rows(
            console,
            (title.removesuffix("s"), "", "node", "type", "group"),
            (
                (
                    resource.ros_name,
                    _ROLES[resource.type] + (" (hardware-mapped)" if resource.hardware_mapped else ""),
                    resource.node,
                    resource.interface,
                    resource.group,
                )
                for resource in resources
                if resource.type in types
            ),
            title=title,
        )
    timers = (resource for resource in resources if resource.type == "rostmr")
    print_rows(
        console,
        ("timer", "period [ms]", "node", "group"),
        ((timer.name, timer.number, timer.node, timer.group) for timer in timers),
        title="timers",
    )
