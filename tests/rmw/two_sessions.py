"""Two sessions in one simulated network, each with a clock of its own."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.qos import QosProfile
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.transport.base import Request, Sample

types = cache(TypeRegistry)
QOS = QosProfile()


class TwoSessions:
    """`here` is session a1, `there` session b2; their clocks say what the test sets."""

    def __init__(self, domain_here: int = 0, domain_there: int = 0) -> None:
        self.environment = VirtualEnvironment()
        self.network = SimulatedNetwork(self.environment)
        self.here_ns = 1000
        self.there_ns = 1000
        self.here = Context(self.network.transport("a1"), domain_here, lambda: self.here_ns)
        self.there = Context(self.network.transport("b2"), domain_there, lambda: self.there_ns)

    def settle(self) -> None:
        """Let everything happen that is due."""
        self.environment.run(until=self.environment.now + 1)

    def listen(self, key: str) -> list[Sample]:
        """What comes over the wire on a key expression, as it is."""
        samples: list[Sample] = []
        self.network.transport("c3").subscribe(key, samples.append, QOS)
        return samples

    def serve(self, key: str, sink: Callable[[Request], None]) -> None:
        """Answer requests as they come over the wire."""
        self.network.transport("c3").serve(key, sink)

    def tokens(self, pattern: str = "@ros2_lv/**") -> list[str]:
        """The liveliness tokens in the network, sorted."""
        return sorted(self.network.transport("d4").tokens(pattern, 0))
