"""Hash calculation: on a timer, the SHA-256 of an image in main memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.applications.roundtrip.kernels.hash import sha256, source

if TYPE_CHECKING:
    from collections.abc import Generator

    import numpy as np
    from numpy.typing import NDArray

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.ros.types import MessageType


class Hash:
    """Publishes std_msgs/UInt32MultiArray with 8 elements each time the timer expires."""

    def __init__(self, publisher: MessageWriter, layout: MessageType) -> None:
        """`layout` is std_msgs/MultiArrayLayout."""
        self._publisher = publisher
        self._layout = layout.cls(dim=[], data_offset=0)

    def software(self, _: None, context: SoftwareContext) -> None:
        """Publish the digest."""
        context.publish(self._publisher, self._answer(context.compute(sha256, source())))

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Publish the digest."""
        yield from thread.get_init_data()
        ram = yield from thread.mem_read(source())
        digest = yield from thread.compute(sha256, ram)
        yield from thread.mem_write(digest, to=self._publisher)
        yield from thread.publish(self._publisher, self._answer(digest))

    def _answer(self, digest: NDArray[np.uint32]) -> Any:
        return self._publisher.message(layout=self._layout, data=digest)
