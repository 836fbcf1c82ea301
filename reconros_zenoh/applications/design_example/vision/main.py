"""Listing 4 in Python: two hardware callbacks in the slots that the mapping gives them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.applications.design_example.vision.callbacks import Filter, InvKinematics
from reconros_zenoh.applications.roundtrip.callbacks.checks import check_leg
from reconros_zenoh.board.timing import Cycles
from reconros_zenoh.ros.qos import QosProfile, Reliability

if TYPE_CHECKING:
    from reconros_zenoh.project.application import Application

# Table I gives 16.5 ms and 0.35 ms from start to completion; these are the compute times left without memory
# transfers and calls in the profile of the measured board, 11.872 ms and 0.33 ms at 120 MHz.
FILTER_CYCLES = 1_424_640
INVERSE_CYCLES = 39_600

NEWEST = QosProfile(reliability=Reliability.BEST_EFFORT, depth=1)
"""For pictures: a late one is worth less than the next. With the default the communication stack holds up all
that follow, for up to 3 s, until a lost fragment has been repaired."""


def main(app: Application) -> None:
    """Register both callbacks, and spin."""
    inverse = InvKinematics(app.writer("ResourceGroupInverse", "pub"))
    app.register(
        "inv_kinematics",
        "sub",
        hardware=inverse.hardware,
        check=check_leg,
        hardware_timing=Cycles(INVERSE_CYCLES),
    )
    sobel = Filter(app.writer("ResourceGroupSobel", "pub"), app.types.message("sensor_msgs/msg/Image"))
    app.register(
        "filter",
        "sub",
        hardware=sobel.hardware,
        check=sobel.check,
        hardware_timing=Cycles(FILTER_CYCLES),
        qos=NEWEST,
    )
    app.spin()
