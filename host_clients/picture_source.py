"""Pictures on /image_raw: what the camera of the design example and the robot's have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.errors import TransportError
from reconros_zenoh.ros.image import image_message
from reconros_zenoh.ros.stamp import set_stamp

if TYPE_CHECKING:
    from collections.abc import Generator

    import numpy as np
    import simpy
    from numpy.typing import NDArray

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.type_registry import TypeRegistry


class PictureSource:
    """A publisher of pictures, uint8[height, width, 3] in the order blue, green, red.

    The header carries when a picture was sent (the context's clock) and, as frame_id, its name.
    """

    def __init__(self, environment: VirtualEnvironment, node: Node, types: TypeRegistry) -> None:
        self._environment = environment
        self._node = node
        self._types = types
        self._matched = environment.event()
        self._publisher = node.publisher(
            types.message("sensor_msgs/msg/Image"), "/image_raw", on_matching=self._match
        )

    def until_matched(self, wait_s: float) -> Generator[simpy.Event, object, None]:
        """Return once somebody subscribes; raise TransportError when nobody does within `wait_s`."""
        yield self._matched | self._environment.timeout(round(wait_s * 1e9))
        if not self._matched.triggered:
            raise TransportError(
                f"nobody in domain {self._node.context.domain} subscribed to /image_raw within {wait_s:g} s. "
                "Start a board that takes pictures, with the same --router and --domain."
            )

    def publish(self, name: str, picture: NDArray[np.uint8]) -> int:
        """Publish a picture and return its time [ns]."""
        message = image_message(self._types, "bgr8", picture)
        now_ns = self._node.context.clock_ns()
        set_stamp(message.header.stamp, now_ns)
        message.header.frame_id = name
        self._publisher.publish(message)
        return now_ns

    def _match(self, matching: bool) -> None:
        """Note, on any thread, whether somebody subscribes."""
        if matching:
            self._environment.post(succeed_once, self._matched)
