"""Sobel filter: an image in, its edges out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.applications.roundtrip.callbacks.checks import check_image
from reconros_zenoh.applications.roundtrip.kernels.sobel import SHAPE, sobel
from reconros_zenoh.ros.image import image_fields

if TYPE_CHECKING:
    from collections.abc import Generator

    import numpy as np
    from numpy.typing import NDArray

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable

HEIGHT, WIDTH, CHANNELS = SHAPE


class Sobel:
    """Subscribes to sensor_msgs/Image, publishes sensor_msgs/Image: bgr8, 640 x 480."""

    def __init__(self, publisher: MessageWriter) -> None:
        self._publisher = publisher

    def check(self, message: Any) -> None:
        """Raise BadMessageError for an image of another size or encoding."""
        check_image(message, "bgr8", HEIGHT, WIDTH, CHANNELS)

    def software(self, message: Any, context: SoftwareContext) -> None:
        """Publish the filtered image."""
        edges = context.compute(sobel, message.data.reshape(SHAPE))
        context.publish(self._publisher, self._answer(message, edges))

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Publish the filtered image (Listing 2)."""
        message = yield from thread.get_init_data()
        ram = yield from thread.mem_read(message.data)
        edges = yield from thread.compute(sobel, ram.reshape(SHAPE))
        yield from thread.mem_write(edges, to=self._publisher)
        yield from thread.publish(self._publisher, self._answer(message, edges))

    def _answer(self, message: Any, edges: NDArray[np.uint8]) -> Any:
        return self._publisher.message(header=message.header, **image_fields("bgr8", edges))
