"""/camera: publishes a moving test picture at a fixed rate (ReconROS Executor, Fig. 1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from host_clients.image import image_message
from reconros_zenoh.applications.design_example.picture import moving_picture
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.errors import TransportError

if TYPE_CHECKING:
    from collections.abc import Generator

    import simpy

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.ros.types import TypeRegistry

_SECOND_NS = 1_000_000_000
_ON_THE_WAY_NS = 2 * _SECOND_NS


@dataclass(frozen=True, slots=True)
class CameraOptions:
    """What a camera is told; with `group` it begins once its `members` are there."""

    router: str
    pictures: int
    rate_hz: float = 5.0
    wait_s: float = 30.0
    domain: int = 0
    group: str | None = None
    members: int = 1


class Camera:
    """Publishes pictures on /image_raw; `done` happens 2 s after the last, when it will have arrived.

    It begins once somebody subscribes and `start` has happened, and fails with TransportError when nobody
    does. The header carries when a picture was sent (the context's clock) and, as frame_id, its number.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        context: Context,
        types: TypeRegistry,
        options: CameraOptions,
        start: simpy.Event,
    ) -> None:
        self.sent = 0
        self._environment = environment
        self._types = types
        self._options = options
        self._matched = environment.event()
        self._node = context.node("camera")
        self._publisher = self._node.publisher(
            types.message("sensor_msgs/msg/Image"), "/image_raw", on_matching=self._match
        )
        self.done = environment.process(self._run(start))

    def _run(self, start: simpy.Event) -> Generator[simpy.Event, object, None]:
        options = self._options
        yield self._matched | self._environment.timeout(round(options.wait_s * _SECOND_NS))
        if not self._matched.triggered:
            raise TransportError(
                f"nobody in domain {options.domain} subscribed to /image_raw within {options.wait_s:g} s. "
                "Start a board that filters pictures, with the same --router and --domain."
            )
        yield start
        for number in range(options.pictures):
            self._publish(number)
            yield self._environment.timeout(round(_SECOND_NS / options.rate_hz))
        yield self._environment.timeout(_ON_THE_WAY_NS)

    def _publish(self, number: int) -> None:
        message = image_message(self._types, "bgr8", moving_picture(number))
        seconds, nanoseconds = divmod(self._node.context.clock_ns(), _SECOND_NS)
        message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
        message.header.frame_id = str(number)
        self._publisher.publish(message)
        self.sent += 1

    def _match(self, matching: bool) -> None:
        """Note, on any thread, whether somebody subscribes."""
        if matching:
            self._environment.post(succeed_once, self._matched)
