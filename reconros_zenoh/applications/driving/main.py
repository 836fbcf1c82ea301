"""Registers the nodes of the driving example, each where the mapping wants it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.applications.driving.chain import Chain
from reconros_zenoh.applications.driving.kernels import blur, compensate, plan_lane, shows_green, shows_red
from reconros_zenoh.applications.driving.nodes import (
    Filter,
    LaneControl,
    LightDetection,
    OrbMap,
    Polyfit,
    check_picture,
)
from reconros_zenoh.applications.driving.view import HEIGHT, WIDTH
from reconros_zenoh.board.timing import Cycles
from reconros_zenoh.ros.qos import QosProfile, Reliability

if TYPE_CHECKING:
    from reconros_zenoh.project.application import Application

PER_PICTURE = Cycles(HEIGHT * WIDTH)
"""Assumed, of each node in hardware: a pixel per cycle, as a pipeline over a stream takes them."""

SHORT = Cycles(20_000)
"""Assumed: a few floating point operations and what surrounds them."""

ORB = Cycles(60_000_000)
"""Assumed: 50 ms for the key points of a picture at 1.2 GHz."""

NEWEST = QosProfile(reliability=Reliability.BEST_EFFORT, depth=1)
"""For what the camera sends: a late picture is worth less than the next."""


def main(app: Application) -> None:
    """Register the nodes, and spin."""
    run_nodes(app, Chain(app.board.environment.clock_ns))


def run_nodes(app: Application, chain: Chain) -> None:
    """Register the nodes, which note in the chain when they have a picture, and spin."""
    for name, kernel in (("compensation", compensate), ("blur", blur), ("lane_planner", plan_lane)):
        first = name == "compensation"
        app.register(
            name,
            "sub",
            hardware=Filter(name, chain, kernel, app.writer(name, "pub")).hardware,
            hardware_timing=PER_PICTURE,
            check=check_picture if first else None,
            qos=NEWEST if first else None,
        )
    polyfit = Polyfit(chain, app.writer("polyfit", "pub"))
    app.register("polyfit", "sub", hardware=polyfit.hardware, hardware_timing=PER_PICTURE)

    lane_control = LaneControl(chain, app.writer("lane_control", "pub"), app.types)
    app.register("lane_control", "sub", software=lane_control.on_lane, software_timing=SHORT)
    app.register("stop", "sub", software=lane_control.on_red, software_timing=SHORT)
    app.register("go", "sub", software=lane_control.on_green, software_timing=SHORT)

    for colour, shows in (("red", shows_red), ("green", shows_green)):
        name = f"{colour}_light"
        detection = LightDetection(shows, app.writer(name, "pub"), app.mbox(name, "watch"))
        app.register(name, "sub", hardware=detection.hardware, hardware_timing=PER_PICTURE)
        app.register(f"watch_for_{colour}", "sub", software=detection.watch, software_timing=SHORT)
        if colour == "red":
            detection.begin()

    orb_map = OrbMap(app.writer("map", "pub"))
    app.register("map", "sub", software=orb_map.on_picture, software_timing=ORB)
    app.spin()
