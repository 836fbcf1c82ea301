"""MNIST classifier: an image of a digit in, the digit out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.applications.roundtrip.callbacks.checks import check_image
from reconros_zenoh.applications.roundtrip.kernels.mnist import SIDE, shipped_classifier

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable


class Mnist:
    """Subscribes to sensor_msgs/Image (mono8, 28 x 28), publishes std_msgs/UInt32."""

    def __init__(self, publisher: MessageWriter) -> None:
        self._publisher = publisher
        self._classify = shipped_classifier().classify

    def check(self, message: Any) -> None:
        """Raise BadMessageError for an image of another size or encoding."""
        check_image(message, "mono8", SIDE, SIDE, 1)

    def software(self, message: Any, context: SoftwareContext) -> None:
        """Publish the digit."""
        digit = context.compute(self._classify, message.data.reshape(SIDE, SIDE))
        context.publish(self._publisher, self._publisher.message(data=digit))

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Publish the digit."""
        message = yield from thread.get_init_data()
        ram = yield from thread.mem_read(message.data)
        digit = yield from thread.compute(self._classify, ram.reshape(SIDE, SIDE))
        yield from thread.mem_write(np.array([digit], np.uint32), to=self._publisher)
        yield from thread.publish(self._publisher, self._publisher.message(data=digit))
