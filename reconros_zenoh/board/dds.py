"""What a message costs between the network and the reader or writer of a node."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import random
    from collections.abc import Generator

    import simpy

    from reconros_zenoh.board.cpu import Cpu
    from reconros_zenoh.board.profile import Model
    from reconros_zenoh.board.spans import Timeline
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
        self._model = model
        self._randomness = randomness

    def receive(self, size: int, transit_ns: int, timeline: Timeline) -> Generator[simpy.Event, object, None]:
        """Return when a message of `size` bytes that left `transit_ns` ago has come through the stack."""
        if self._model is None:
            timeline.mark("transport")
            return
        yield from self._cross_link(size, transit_ns)
        timeline.mark("transport")
        yield from self._process(size)
        timeline.mark("dds")
        yield from self._retransmit(size, timeline)

    def send(self, size: int, timeline: Timeline) -> Generator[simpy.Event, object, None]:
        """Return when a message of `size` bytes has gone through the stack and over the link."""
        if self._model is None:
            timeline.mark("dds")
            return
        yield from self._process(size)
        timeline.mark("dds")
        yield from self._retransmit(size, timeline)
        yield from self._cross_link(size, 0)
        timeline.mark("transport")

    def _cross_link(self, size: int, transit_ns: int) -> Generator[simpy.Event, object, None]:
        assert self._model is not None
        link = self._model.link
        left_ns = link.latency.ns + round(size * link.per_byte.ns_per_byte) - max(0, transit_ns)
        if left_ns > 0:
            yield self._environment.timeout(left_ns)

    def _process(self, size: int) -> Generator[simpy.Event, object, None]:
        assert self._model is not None
        dds = self._model.dds
        per_byte = dds.per_byte_large if size > dds.large_from.bytes else dds.per_byte
        return self._cpu.run_stack(dds.per_message.ns + size * per_byte.ns_per_byte)

    def _retransmit(self, size: int, timeline: Timeline) -> Generator[simpy.Event, object, None]:
        assert self._model is not None
        dds = self._model.dds
        while size > dds.large_from.bytes and self._randomness.random() < dds.nack_probability.share:
            yield self._environment.timeout(
                dds.nack_delay.ns + round(size * self._model.link.per_byte.ns_per_byte)
            )
            yield from self._process(size)
            timeline.mark("retransmission")
