"""The hardware callbacks of /filter and /inv_kinematics (ReconROS Executor, Section IV, Listings 2 and 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.applications.roundtrip.callbacks.checks import check_image
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics
from reconros_zenoh.applications.roundtrip.kernels.sobel import SHAPE, sobel

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.ros.types import MessageType

IMAGE_BYTES = int(np.prod(SHAPE))


class Filter:
    """Subscribes to sensor_msgs/Image, bgr8 of 640 x 480, and publishes its edges in place of the picture."""

    def __init__(self, publisher: MessageWriter, image: MessageType) -> None:
        self._publisher = publisher
        self._image = image

    def check(self, message: Any) -> None:
        """Raise BadMessageError for an image of another size or encoding."""
        check_image(message, "bgr8", *SHAPE)

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Publish the filtered image (Listing 2)."""
        message = yield from thread.get_init_data()
        offset = thread.offsetof(self._image, "data.data")
        payload = yield from thread.mem_read(message + offset, 4)
        ram = yield from thread.mem_read(payload[0], IMAGE_BYTES, np.uint8)
        edges = yield from thread.compute(sobel, ram.reshape(SHAPE))
        yield from thread.mem_write(edges, payload[0])
        yield from thread.publish(self._publisher, message)
        yield from thread.exit()


class InvKinematics:
    """Subscribes to std_msgs/UInt32, a packed orientation, and publishes the servo index in its place.

    Deviation: Listing 3 reads a pointer to the number; in the struct that rosidl makes of UInt32 the number
    itself stands there.
    """

    def __init__(self, publisher: MessageWriter) -> None:
        self._publisher = publisher

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Publish the servo index (Listing 3)."""
        message = yield from thread.get_init_data()
        ram = yield from thread.mem_read(message, 4)
        word = yield from thread.compute(inverse_kinematics, int(ram[0]))
        yield from thread.mem_write(np.array([word], np.uint32), message)
        yield from thread.publish(self._publisher, message)
        yield from thread.exit()
