"""What a message costs between the network and the reader or writer of a node."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import random
    from collections.abc import Generator

    from reconros_zenoh.board.cpu import Cpu
    from reconros_zenoh.board.profile import Model
    from reconros_zenoh.board.spans import Timeline
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class DdsStack:
    """The link of the board and the communication stack on its cores; free where nothing is modelled.

    The link is charged here rather than in the transport, so that the same model holds in both clocks. In
    wall time a message has spent some of the modelled link time in the real network already: its source
    timestamp says how much, and only the rest is waited for.
    """

    def __init__(
        self, environment: VirtualEnvironment, cpu: Cpu, model: Model | None, randomness: random.Random
    ) -> None:
        self._environment = environment
        self._cpu = cpu
        self._randomness = randomness
        self._modelled = model is not None
        if model is not None:
            dds, link = model.dds, model.link
            self._latency_ns = link.latency.ns
            self._link_ns_per_byte = link.per_byte.ns_per_byte
            self._message_ns = dds.per_message.ns
            self._ns_per_byte = dds.per_byte.ns_per_byte
            self._ns_per_byte_large = dds.per_byte_large.ns_per_byte
            self._large_from = dds.large_from.bytes
            self._nack_probability = dds.nack_probability.share
            self._nack_delay_ns = dds.nack_delay.ns

    def receive(self, size: int, transit_ns: int, timeline: Timeline) -> Generator[Awaitable, object, None]:
        """Return when a message of `size` bytes that left `transit_ns` ago has come through the stack."""
        if not self._modelled:
            timeline.mark("transport")
            return
        yield from self._cross_link(size, transit_ns)
        timeline.mark("transport")
        yield from self._process(size)
        timeline.mark("dds")
        yield from self._retransmit(size, timeline)

    def send(self, size: int, timeline: Timeline) -> Generator[Awaitable, object, None]:
        """Return when a message of `size` bytes has gone through the stack and over the link."""
        if not self._modelled:
            timeline.mark("dds")
            return
        yield from self._process(size)
        timeline.mark("dds")
        yield from self._retransmit(size, timeline)
        yield from self._cross_link(size, 0)
        timeline.mark("transport")

    def _cross_link(self, size: int, transit_ns: int) -> Generator[Awaitable, object, None]:
        left_ns = self._latency_ns + round(size * self._link_ns_per_byte) - max(0, transit_ns)
        if left_ns > 0:
            yield self._environment.timeout(left_ns)

    def _process(self, size: int) -> Generator[Awaitable, object, None]:
        ns_per_byte = self._ns_per_byte_large if size > self._large_from else self._ns_per_byte
        return self._cpu.run_stack(self._message_ns + size * ns_per_byte)

    def _retransmit(self, size: int, timeline: Timeline) -> Generator[Awaitable, object, None]:
        while size > self._large_from and self._randomness.random() < self._nack_probability:
            yield self._environment.timeout(self._nack_delay_ns + round(size * self._link_ns_per_byte))
            yield from self._process(size)
            timeline.mark("retransmission")
