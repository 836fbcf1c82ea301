"""Camera, viewer and robot of the examples as processes: from their arguments until their end or a signal."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2

from host_clients.camera import Camera
from host_clients.gallery import Gallery
from host_clients.group import gather
from host_clients.picture_server import PictureServer
from host_clients.robot import DrivingRobot
from host_clients.scope import Scope
from host_clients.viewer import Viewer
from reconros_zenoh.clock.process import begin_process
from reconros_zenoh.measure.record import RecordWriter
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from host_clients.camera import CameraOptions
    from host_clients.robot import RobotOptions
    from reconros_zenoh.measure.record import RoundTrip


@dataclass(frozen=True, slots=True)
class ViewerOptions:
    """What a viewer is told: where its records and pictures go, and the port of its page if there is one."""

    out: Path | None = None
    view: int | None = None
    rate_hz: float = 5.0
    domain: int = 0
    group: str | None = None
    members: int = 1


def run_camera(router: str, options: CameraOptions, on_ready: Callable[[], None]) -> int:
    """Publish the pictures and return how many were: fewer than asked for after SIGINT or SIGTERM.

    `on_ready` is called when a signal would end it. Raise TransportError when there is no router, or nobody
    subscribes within `wait_s`.
    """
    environment, stop = begin_process()
    with ZenohTransport.open(router) as transport:
        start = environment.event()
        camera = Camera(environment, Context(transport, options.domain), TypeRegistry(), options, start)
        gather(transport, environment, start, options.group, "camera", options.members)
        on_ready()
        environment.run(until=camera.done | stop)
        return camera.sent


def run_viewer(router: str, options: ViewerOptions, on_ready: Callable[[str | None], None]) -> dict[str, int]:
    """Record what comes until SIGINT or SIGTERM; return how many pictures and servo indices came.

    `on_ready` gets the address of the page, None without one. Records are filter.csv and control.csv.
    Raise TransportError when there is no router, UsageError when a file cannot be written.
    """
    environment, stop = begin_process()
    counts = {"pictures": 0, "indices": 0}
    gallery = Gallery()
    with ExitStack() as closing:
        transport = closing.enter_context(ZenohTransport.open(router))
        records = {
            name: closing.enter_context(RecordWriter(options.out / f"{name}.csv"))
            for name in ("filter", "control")
            if options.out is not None
        }
        server = None
        if options.view is not None:
            server = closing.enter_context(PictureServer(options.view, "/image_filtered"))

        def record(name: str, kind: str) -> Callable[[RoundTrip], None]:
            def write(trip: RoundTrip) -> None:
                counts[kind] += trip.outcome != "lost"
                if name in records:
                    records[name].write(trip)

            return write

        def show(picture: NDArray[np.uint8]) -> None:
            gallery.add(picture)
            if server is not None:
                server.show(picture)

        context, types = Context(transport, options.domain), TypeRegistry()
        Viewer(environment, context, types, record("filter", "pictures"), show)
        Scope(environment, context, types, record("control", "indices"))
        on_ready(None if server is None else server.url)
        gather(transport, environment, environment.event(), options.group, "viewer", options.members)
        environment.run(until=stop)
    if options.out is not None:
        gallery.write(options.out, options.rate_hz)
    return counts


def run_robot(router: str, options: RobotOptions, on_ready: Callable[[str | None], None]) -> DrivingRobot:
    """Drive, and return the robot when its pictures are taken, or after SIGINT or SIGTERM.

    `on_ready` gets the address of the page, None without one. The record is robot.csv. Raise TransportError
    when there is no router or nobody subscribes within `wait_s`, UsageError when a file cannot be written.
    """
    environment, stop = begin_process()
    with ExitStack() as closing:
        transport = closing.enter_context(ZenohTransport.open(router))
        record = server = None
        if options.out is not None:
            record = closing.enter_context(RecordWriter(options.out / "robot.csv"))
        if options.view is not None:
            server = closing.enter_context(PictureServer(options.view, "what the robot sees"))

        def write(trip: RoundTrip) -> None:
            if record is not None:
                record.write(trip)

        def show(picture: NDArray[np.uint8], speed: float) -> None:
            if server is not None:
                shown, font, white = picture.copy(), cv2.FONT_HERSHEY_SIMPLEX, (255, 255, 255)
                cv2.putText(shown, f"{speed:.1f} m/s", (8, 470), font, 1, white, 2)
                server.show(shown)

        context = Context(transport, options.domain)
        robot = DrivingRobot(environment, context, TypeRegistry(), options, write, show)
        on_ready(None if server is None else server.url)
        environment.run(until=robot.done | stop)
    return robot
