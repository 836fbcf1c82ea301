"""/camera: publishes a moving test picture at a fixed rate (ReconROS Executor, Fig. 1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from host_clients.picture_source import PictureSource
from reconros_zenoh.applications.design_example.picture import moving_picture

if TYPE_CHECKING:
    from collections.abc import Generator

    import simpy

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.ros.type_registry import TypeRegistry

_SECOND_NS = 1_000_000_000
_ON_THE_WAY_NS = 2 * _SECOND_NS


@dataclass(frozen=True, slots=True)
class CameraOptions:
    """What a camera is told; with `group` it begins once its `members` are there."""

    pictures: int
    rate_hz: float = 5.0
    wait_s: float = 30.0
    domain: int = 0
    group: str | None = None
    members: int = 1


class Camera:
    """Publishes pictures on /image_raw; `done` happens 2 s after the last, when it will have arrived.

    It begins once somebody subscribes and `start` has happened, and fails with TransportError when nobody
    does.
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
        self._options = options
        self._source = PictureSource(environment, context.node("camera"), types)
        self.done = environment.process(self._run(start))

    def _run(self, start: simpy.Event) -> Generator[simpy.Event, object, None]:
        options = self._options
        yield from self._source.until_matched(options.wait_s)
        yield start
        for number in range(options.pictures):
            self._source.publish(str(number), moving_picture(number))
            self.sent += 1
            yield self._environment.timeout(round(_SECOND_NS / options.rate_hz))
        yield self._environment.timeout(_ON_THE_WAY_NS)
