"""The sort client against a server that takes its time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from host_clients.closed_loop import ClosedLoop
from host_clients.suite import exchange
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.measure.record import RoundTrip
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from reconros_zenoh.rmw.received import Received

SECOND_NS = 10**9


def sorted_after(seconds: int, limit_s: int) -> RoundTrip:
    """Return a round trip to a server that answers the first request at once and others so much later."""
    environment = VirtualEnvironment()
    network, types = SimulatedNetwork(environment), TypeRegistry()
    trips: list[RoundTrip] = []
    start = environment.event()
    loop = ClosedLoop(
        environment,
        exchange("sort", seed=1),
        Context(network.transport("c0"), 0, environment.clock_ns).node("client"),
        types,
        requests=1,
        limit_ns=limit_s * SECOND_NS,
        start=start,
        on_round_trip=trips.append,
    )
    service = types.service("sorter_msgs/srv/Sort")

    def sort(received: Received) -> None:
        assert received.responder is not None
        answer = service.response.cls(sorted=np.sort(received.message.unsorted))
        parts = service.response.encode(answer)
        delay_ns = seconds * SECOND_NS if start.triggered else 0
        environment.call_later(delay_ns, received.responder.respond_encoded, parts)

    Context(network.transport("b0"), 0, environment.clock_ns).node("server").service(service, "/sorter", sort)
    environment.run(until=loop.warm)
    start.succeed()
    environment.run(until=loop.done)
    (trip,) = trips
    return trip


def test_an_answer_within_a_long_limit_counts() -> None:
    assert sorted_after(seconds=70, limit_s=100) == RoundTrip(0, 70 * SECOND_NS, "ok")


def test_an_answer_behind_the_limit_is_lost() -> None:
    assert sorted_after(seconds=70, limit_s=60) == RoundTrip(0, None, "lost")
