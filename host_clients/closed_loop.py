"""A closed loop: the next request leaves when the answer is in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.measure.record import RoundTrip

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import simpy

    from host_clients.exchange import Exchange
    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.type_registry import TypeRegistry


class ClosedLoop:
    """Asks, waits, checks, records, and asks again: N times, then `done`.

    First it waits until somebody serves its requests and repeats an unrecorded request until one is answered;
    `warm` happens then. It goes on once `start` has happened. A round trip is measured on the environment's
    clock, from just before the request is sent (where the exchange asks nothing, from the last answer) to the
    answer's arrival on the transport's thread. A request without answer after `limit_ns` is lost and the loop
    goes on; should its answer come later, it is left aside.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        exchange: Exchange,
        node: Node,
        types: TypeRegistry,
        *,
        requests: int,
        limit_ns: int,
        start: simpy.Event,
        on_round_trip: Callable[[RoundTrip], None],
    ) -> None:
        self._environment = environment
        self._exchange = exchange
        self._requests = requests
        self._limit_ns = limit_ns
        self._start = start
        self._on_round_trip = on_round_trip
        self._matched = environment.event()
        self._arrival: simpy.Event | None = None
        self._deadline_ns = 0
        self._watched = False
        self._last_arrival_ns = 0
        self._lost: list[int] = []
        self.warm = environment.event()
        exchange.open(node, types, self._arrive, self._match)
        exchange.prepare(requests)
        self.done = environment.process(self._run())

    def _run(self) -> Generator[simpy.Event, object, None]:
        yield self._matched
        # Its index is far from those of the first requests, so that its late answer cannot be taken for
        # theirs.
        while (yield from self._round_trip(-1)).outcome == "lost":
            pass
        self.warm.succeed()
        yield self._start
        for index in range(self._requests):
            self._on_round_trip((yield from self._round_trip(index)))

    def _round_trip(self, index: int) -> Generator[simpy.Event, Any, RoundTrip]:
        asked_ns = self._environment.clock_ns() if self._exchange.asks else self._last_arrival_ns
        deadline_ns = self._environment.now + self._limit_ns
        self._exchange.ask(index, self._limit_ns)
        while True:
            arrival = yield from self._next_arrival(deadline_ns)
            if arrival is None:
                self._lost.append(index)
                return RoundTrip(index, None, "lost")
            arrived_ns, message = arrival
            if self._exchange.is_right(index, message):
                break
            late = next((lost for lost in self._lost if self._exchange.is_right(lost, message)), None)
            if late is None:
                self._last_arrival_ns = arrived_ns
                return RoundTrip(index, arrived_ns - asked_ns, "wrong")
            self._lost.remove(late)
        self._last_arrival_ns = arrived_ns
        return RoundTrip(index, arrived_ns - asked_ns, "ok")

    def _next_arrival(self, deadline_ns: int) -> Generator[simpy.Event, Any, tuple[int, Any] | None]:
        """Return when the next answer arrived and the answer, or None at the deadline."""
        self._deadline_ns = deadline_ns
        self._arrival = self._environment.event()
        if not self._watched:
            self._watch()
        arrival: tuple[int, Any] | None = yield self._arrival
        return arrival

    def _match(self, matching: bool) -> None:
        """Note, on any thread, whether somebody serves the requests."""
        if matching:
            self._environment.post(succeed_once, self._matched)

    def _arrive(self, message: object) -> None:
        """Note, on any thread, that an answer has come."""
        arrived_ns = self._environment.clock_ns()
        self._environment.post(self._arrived, (arrived_ns, message))

    def _watch(self) -> None:
        """End the present wait at its deadline: one call at a time, which looks when the next is due."""
        waiting = self._arrival is not None
        left_ns = self._deadline_ns - self._environment.now
        self._watched = waiting and left_ns > 0
        if self._watched:
            self._environment.call_later(left_ns, self._watch)
        elif waiting:
            self._arrived(None)

    def _arrived(self, arrival: tuple[int, object] | None) -> None:
        """End the present wait, if there is one."""
        event, self._arrival = self._arrival, None
        if event is not None:
            event.succeed(arrival)
