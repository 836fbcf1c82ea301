"""/viewer: takes the filtered pictures, checks and measures them (ReconROS Executor, Fig. 1)."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.applications.design_example.picture import FRAMES, moving_picture
from reconros_zenoh.applications.roundtrip.callbacks.checks import check_image
from reconros_zenoh.applications.roundtrip.kernels.sobel import SHAPE, sobel
from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.measure.record import RoundTrip
from reconros_zenoh.ros.stamp import stamp_ns

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.type_registry import TypeRegistry

_MOST_DIGITS = 12
_MOST_LEFT_OUT = 100_000  # hours of pictures; each is one line in the record


class Viewer:
    """Subscribes to /image_filtered and tells of each picture, called by the event loop.

    `on_picture` gets it as uint8[480, 640, 3]. `on_trip` gets its round trip: its number, the time from the
    camera to here on their common clock, and whether it is what the kernel makes of the camera's; numbers
    that were left out are `lost` when a later one comes.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        context: Context,
        types: TypeRegistry,
        on_trip: Callable[[RoundTrip], None],
        on_picture: Callable[[NDArray[np.uint8]], None],
    ) -> None:
        self._environment = environment
        self._on_trip = on_trip
        self._on_picture = on_picture
        self._next = 0
        self._node = context.node("viewer")
        self._node.subscription(
            types.message("sensor_msgs/msg/Image"), "/image_filtered", self._arrive, check=self._check
        )

    def _check(self, message: Any) -> None:
        """Raise BadMessageError for what the camera's pictures cannot have become."""
        check_image(message, "bgr8", *SHAPE)
        text = message.header.frame_id
        if not (text.isdecimal() and len(text) <= _MOST_DIGITS):
            raise BadMessageError("frame_id", f"the frame_id is {text!r}, not a number")
        if int(text) - self._next > _MOST_LEFT_OUT:
            raise BadMessageError("frame_id", f"the frame_id is {text}, far behind {self._next}")
        if stamp_ns(message.header.stamp) > self._node.context.clock_ns():
            raise BadMessageError("stamp", "the picture was taken later than now: the clocks differ")

    def _arrive(self, received: Received) -> None:
        """Note, on any thread, that a picture has come."""
        self._environment.post(self._show, received.message, self._node.context.clock_ns())

    def _show(self, message: Any, arrived_ns: int) -> None:
        number = int(message.header.frame_id)
        for left_out in range(self._next, number):
            self._on_trip(RoundTrip(left_out, None, "lost"))
        self._next = number + 1
        picture = message.data.reshape(SHAPE)
        right = np.array_equal(picture, _expected(number % FRAMES))
        time_ns = arrived_ns - stamp_ns(message.header.stamp)
        self._on_trip(RoundTrip(number, time_ns, "ok" if right else "wrong"))
        self._on_picture(picture)


@cache
def _expected(number: int) -> NDArray[np.uint8]:
    return sobel(moving_picture(number))
