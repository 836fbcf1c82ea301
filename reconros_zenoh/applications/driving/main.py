"""Registers the nodes of the driving example, each where the mapping wants it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.applications.driving.kernels import blur, compensate, lets_pass, plan_lane, shows_red
from reconros_zenoh.applications.driving.nodes import (
    Filter,
    LaneControl,
    LightDetection,
    OrbMap,
    Polyfit,
    check_birds_view,
    check_lane,
    check_picture,
)
from reconros_zenoh.applications.driving.view import HEIGHT, WIDTH
from reconros_zenoh.board.timing import Cycles
from reconros_zenoh.ros.qos import QosProfile, Reliability

if TYPE_CHECKING:
    from reconros_zenoh.applications.driving.nodes import Note
    from reconros_zenoh.project.application import Application

PER_PICTURE = Cycles(HEIGHT * WIDTH)
"""Assumed, of each node in hardware: a pixel per cycle, once the picture is in the slot."""

SHORT = Cycles(20_000)
"""Assumed: a few floating point operations and what surrounds them."""

ORB = Cycles(60_000_000)
"""Assumed: 50 ms for the key points of a picture at 1.2 GHz."""

NEWEST = QosProfile(reliability=Reliability.BEST_EFFORT, depth=1)
"""For what the camera sends: a late picture is worth less than the next."""


def main(app: Application) -> None:
    """Register the nodes, and spin."""
    run_nodes(app, lambda *_: None)


def run_nodes(app: Application, note: Note) -> None:
    """Register the nodes, which call `note` when they have a picture, and spin."""
    for name, kernel in (("compensation", compensate), ("blur", blur), ("lane_planner", plan_lane)):
        app.register(
            name,
            "sub",
            hardware=Filter(name, note, kernel, app.writer(name, "pub")).hardware,
            hardware_timing=PER_PICTURE,
            check=check_picture,
            qos=NEWEST if name == "compensation" else None,
        )
    polyfit = Polyfit(note, app.writer("polyfit", "pub"))
    app.register(
        "polyfit", "sub", hardware=polyfit.hardware, hardware_timing=PER_PICTURE, check=check_birds_view
    )

    lane_control = LaneControl(note, app.writer("lane_control", "pub"), app.types)
    app.register(
        "lane_control", "sub", software=lane_control.on_lane, software_timing=SHORT, check=check_lane
    )
    app.register("stop", "sub", software=lane_control.on_red, software_timing=SHORT)
    app.register("go", "sub", software=lane_control.on_green, software_timing=SHORT)

    red, green = (
        LightDetection(tells, app.writer(name, "pub"), app.mbox(name, "watch"))
        for name, tells in (("red_light", shows_red), ("green_light", lets_pass))
    )
    red.begin()
    for colour, detection in (("red", red), ("green", green)):
        app.register(
            f"{colour}_light",
            "sub",
            hardware=detection.hardware,
            hardware_timing=PER_PICTURE,
            check=check_picture,
        )
        app.register(f"watch_for_{colour}", "sub", software=detection.watch, software_timing=SHORT)

    orb_map = OrbMap(app.writer("map", "pub"))
    app.register("map", "sub", software=orb_map.on_picture, software_timing=ORB, check=check_picture)
    app.spin()
