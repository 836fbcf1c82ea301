"""Inverse kinematics: an angle in, a servo index out, one 32-bit word each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.applications.roundtrip.callbacks.checks import check_leg
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable


class Inverse:
    """Subscribes to std_msgs/UInt32, publishes std_msgs/UInt32."""

    def __init__(self, publisher: MessageWriter) -> None:
        self._publisher = publisher

    def check(self, message: Any) -> None:
        """Raise BadMessageError for a leg that the platform does not have."""
        check_leg(message)

    def software(self, message: Any, context: SoftwareContext) -> None:
        """Publish the servo index."""
        word = context.compute(inverse_kinematics, message.data)
        context.publish(self._publisher, self._publisher.message(data=word))

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Publish the servo index (Listing 3)."""
        message = yield from thread.get_init_data()
        ram = yield from thread.mem_read(np.array([message.data], np.uint32))
        word = yield from thread.compute(inverse_kinematics, int(ram[0]))
        yield from thread.mem_write(np.array([word], np.uint32), to=self._publisher)
        yield from thread.publish(self._publisher, self._publisher.message(data=word))
