"""Registers the controller, the motor and the sensor of the platform."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.applications.design_example.control.callbacks import ActorDriver, PidCtrl
from reconros_zenoh.board.timing import Cycles

if TYPE_CHECKING:
    from reconros_zenoh.project.application import Application

_SHORT = Cycles(20_000)
"""Assumed: a few floating point operations and what surrounds them, 30 us at 666 MHz."""


def main(app: Application) -> None:
    """Register the three callbacks of the two nodes, and spin."""
    pid = PidCtrl(app.writer("pid_ctrl", "pub"))
    actor = ActorDriver(app.writer("sensor", "pub"))
    app.register("pid_ctrl", "sub", software=pid.on_position, software_timing=_SHORT)
    app.register("motor", "sub", software=actor.on_index, check=actor.check, software_timing=_SHORT)
    app.register("sensor", "timer", software=actor.on_timer, software_timing=_SHORT)
    app.spin()
