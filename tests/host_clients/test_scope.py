"""The scope when nobody answers commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from host_clients.scope import Scope
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from reconros_zenoh.measure.record import RoundTrip


def test_commands_that_nobody_answers_are_lost_before_they_pile_up() -> None:
    environment, types = VirtualEnvironment(), TypeRegistry()
    network = SimulatedNetwork(environment)
    here, there = (Context(network.transport(name), 0, lambda: 0) for name in ("a1", "b2"))
    trips: list[RoundTrip] = []
    Scope(environment, here, types, trips.append)
    word = types.message("std_msgs/msg/UInt32")
    publisher = there.node("hostile").publisher(word, "/ctrl_out")
    environment.run(until=1)
    for _ in range(1003):
        publisher.publish(word.cls(data=0))
    environment.run(until=2)
    assert [(trip.index, trip.outcome) for trip in trips] == [(0, "lost"), (1, "lost"), (2, "lost")]
