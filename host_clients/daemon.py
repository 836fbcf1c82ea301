"""One client as a process: from its arguments until its last answer or a signal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from host_clients.closed_loop import ClosedLoop
from host_clients.group import gather
from host_clients.suite import exchange
from reconros_zenoh.clock.process import begin_process
from reconros_zenoh.errors import TransportError
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.measure.record import RoundTrip


@dataclass(frozen=True, slots=True)
class ClientOptions:
    """What a client process is told.

    With `group` it waits until `members` clients of that group are warm, so that all begin together.
    """

    name: str
    requests: int
    limit_s: float = 2.0
    wait_s: float = 30.0
    domain: int = 0
    seed: int = 0
    group: str | None = None
    members: int = 1


def run_client(router: str, options: ClientOptions, on_round_trip: Callable[[RoundTrip], None]) -> bool:
    """Make the round trips; return True when all were made, False after SIGINT or SIGTERM.

    Raise TransportError when there is no router, or when no board answers within `wait_s`.
    """
    environment, stop = begin_process()
    with ZenohTransport.open(router) as transport:
        node = Context(transport, options.domain).node(f"{options.name}_client")
        start = environment.event()
        loop = ClosedLoop(
            environment,
            exchange(options.name, options.seed),
            node,
            TypeRegistry(),
            requests=options.requests,
            limit_ns=round(options.limit_s * 1e9),
            start=start,
            on_round_trip=on_round_trip,
        )
        patience = environment.timeout(round(options.wait_s * 1e9))
        environment.run(until=loop.warm | patience | stop)
        if not (loop.warm.triggered or stop.triggered):
            raise TransportError(
                f"no board answered the {options.name} client within {options.wait_s:g} s. Start one with "
                f"`reconros board`, with the same --router and --domain."
            )
        gather(transport, environment, start, options.group, options.name, options.members)
        environment.run(until=loop.done | stop)
        return loop.done.triggered
