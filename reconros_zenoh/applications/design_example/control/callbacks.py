"""The software callbacks of /pid_ctrl and /actor_driver (ReconROS Executor, Fig. 1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.applications.design_example.control.plant import (
    LEG,
    Pid,
    Platform,
    command,
    setpoint,
)
from reconros_zenoh.applications.roundtrip.kernels.inverse import STEPS_PER_DEGREE
from reconros_zenoh.errors import BadMessageError

if TYPE_CHECKING:
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.writers import MessageWriter


class PidCtrl:
    """Publishes a packed orientation for each position of the sensor."""

    def __init__(self, publisher: MessageWriter) -> None:
        self._publisher = publisher
        self._pid = Pid()
        self._samples = 0

    def on_position(self, message: Any, context: SoftwareContext) -> None:
        """Publish the angle to go to; a position counts 1/256 degree."""
        error = setpoint(self._samples) - message.data / STEPS_PER_DEGREE
        self._samples += 1
        word = command(self._pid.output(error))
        context.publish(self._publisher, self._publisher.message(data=word))


class ActorDriver:
    """Moves the motor to the servo index that comes, and publishes the position every 100 ms.

    Motor and sensor are modelled: nothing turns.
    """

    def __init__(self, publisher: MessageWriter) -> None:
        self._publisher = publisher
        self._platform = Platform()

    def check(self, message: Any) -> None:
        """Raise BadMessageError for the index of a leg that is not moved here."""
        if message.data >> 18 & 0x7 != LEG:
            raise BadMessageError(
                "leg", f"an index for leg {message.data >> 18 & 0x7} came, not for leg {LEG}"
            )

    def on_index(self, message: Any, _: SoftwareContext) -> None:
        """Set the motor signal."""
        self._platform.target = float(message.data >> 21)

    def on_timer(self, _: object, context: SoftwareContext) -> None:
        """Publish where the platform is."""
        tilt = round(self._platform.move() * STEPS_PER_DEGREE)
        context.publish(self._publisher, self._publisher.message(data=tilt))
