"""What a client makes before it begins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from host_clients.closed_loop import ClosedLoop
from host_clients.inverse import InverseExchange
from host_clients.suite import exchange
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    import pytest

    from reconros_zenoh.measure.record import RoundTrip


def test_nothing_is_made_between_round_trips(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    for name in ("request", "expected"):
        make = getattr(InverseExchange, name)

        def noting(*arguments: Any, name: str = name, make: Any = make) -> Any:
            made.append(name)
            return make(*arguments)

        monkeypatch.setattr(InverseExchange, name, noting)
    environment, types = VirtualEnvironment(), TypeRegistry()
    network = SimulatedNetwork(environment)
    here, there = (Context(network.transport(name), 0, environment.clock_ns) for name in ("a1", "b2"))
    trips: list[RoundTrip] = []
    start = environment.event()
    loop = ClosedLoop(
        environment,
        exchange("inverse", seed=1),
        here.node("client"),
        types,
        requests=5,
        limit_ns=10**9,
        start=start,
        on_round_trip=trips.append,
    )
    word = types.message("std_msgs/msg/UInt32")
    board = there.node("board")
    answers = board.publisher(word, "/legangle")
    board.subscription(
        word, "/angle", lambda got: answers.publish(word.cls(data=inverse_kinematics(got.message.data)))
    )
    environment.run(until=loop.warm)
    # Five, and the request that is asked until somebody answers.
    assert made.count("request") == made.count("expected") == 6
    made.clear()
    start.succeed()
    environment.run(until=loop.done)
    assert [trip.outcome for trip in trips] == ["ok"] * 5
    assert made == []
