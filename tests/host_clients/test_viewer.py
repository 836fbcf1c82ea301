"""The viewer and pictures that no camera has taken."""

from __future__ import annotations

import numpy as np
import pytest

from host_clients.viewer import Viewer
from reconros_zenoh.applications.roundtrip.kernels.sobel import SHAPE
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.measure.record import RoundTrip
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.image import image_message
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

NOW_NS = 5_000_000_000


def trips_of(frame_id: str, sec: int) -> tuple[list[RoundTrip], dict[str, int]]:
    """Return what the viewer says of one picture, and what it has refused."""
    environment, types = VirtualEnvironment(), TypeRegistry()
    network = SimulatedNetwork(environment)
    here, there = (Context(network.transport(name), 0, lambda: NOW_NS) for name in ("a1", "b2"))
    trips: list[RoundTrip] = []
    Viewer(environment, here, types, trips.append, lambda _: None)
    publisher = there.node("filter").publisher(types.message("sensor_msgs/msg/Image"), "/image_filtered")
    message = image_message(types, "bgr8", np.zeros(SHAPE, np.uint8))
    message.header.frame_id, message.header.stamp.sec = frame_id, sec
    environment.run(until=1)
    publisher.publish(message)
    environment.run(until=2)
    return trips, dict(here.rejections.counts())


def test_a_picture_and_those_before_it_that_were_lost() -> None:
    trips, refused = trips_of("2", sec=3)
    assert trips == [
        RoundTrip(0, None, "lost"),
        RoundTrip(1, None, "lost"),
        RoundTrip(2, 2_000_000_000, "wrong"),
    ]
    assert refused == {}


@pytest.mark.parametrize(
    ("frame_id", "sec", "reason"),
    [
        ("two", 3, "frame_id"),
        ("9" * 5000, 3, "frame_id"),
        ("99999999999", 3, "frame_id"),
        ("2", 6, "stamp"),
    ],
)
def test_what_no_camera_has_sent_is_refused(frame_id: str, sec: int, reason: str) -> None:
    assert trips_of(frame_id, sec) == ([], {reason: 1})
