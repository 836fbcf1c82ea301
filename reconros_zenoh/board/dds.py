"""What a message costs between the network and the reader or writer of a node."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from reconros_zenoh.board.busy_time import BusyTime
from reconros_zenoh.board.serial_queue import SerialQueue
from reconros_zenoh.clock.activity import Signal

if TYPE_CHECKING:
    import random
    from collections.abc import Generator

    from reconros_zenoh.board.cpu import Cpu
    from reconros_zenoh.board.profile import Model
    from reconros_zenoh.board.spans import Timeline
    from reconros_zenoh.board.trace import Track
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment

_TRANSITS_REMEMBERED = 8


class _Passage(NamedTuple):
    """A message's turn in the stack: which way, how long with free cores, and who waits for its end."""

    way: str
    duration_ns: float
    done: Signal


class DdsStack:
    """The link of the board and the communication stack on its cores; free where nothing is modelled.

    The stack serves one message at a time, in the order in which they come, whatever their node and
    direction: a small message that comes behind a large one waits for it. On the real board that is what
    delays a small round trip by most of a Sobel image's way in and out (reference data, DESIGN.md).

    A large message that comes in may lose a fragment: then it is resent whole after `nack_delay`, or, when
    the request for it is lost too, after the next heartbeat of its writer. What comes while all cores are
    busy or the stack is stalled is lost more often, because the thread that empties the socket gets its turn
    late. The desktop loses nothing.

    The link is charged here rather than in the transport, so that the same model holds in both clocks. In
    wall time a message has spent some of the modelled link time in the real network already: its source
    timestamp says how much, and only the rest is waited for. What the board sends is expected to take as long
    in the real network as what it got lately, and leaves that much earlier.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        cpu: Cpu,
        model: Model | None,
        randomness: random.Random,
        track: Track | None = None,
    ) -> None:
        self._environment = environment
        self._cpu = cpu
        self._randomness = randomness
        self._modelled = model is not None
        self.busy = BusyTime(environment, track)
        # How long small and large messages lately were on their way in the real network; nothing in virtual
        # time.
        self._transit_ns = {False: 0.0, True: 0.0}
        # Nothing is pushed out here: the queues of readers and writers are the ones that overflow.
        self._passages: SerialQueue[_Passage] = SerialQueue(self._pass, None)
        if model is not None:
            dds, link = model.dds, model.link
            self._latency_ns = link.latency.ns
            self._link_ns_per_byte = link.per_byte.ns_per_byte
            self._message_ns = dds.per_message.ns
            self._ns_per_byte = dds.per_byte.ns_per_byte
            self._receive_ns_per_byte = dds.receive_per_byte_large.ns_per_byte
            self._send_ns_per_byte = dds.send_per_byte_large.ns_per_byte
            self._large_from = dds.large_from.bytes
            self._core_share = dds.core_share.share
            self._jitter = dds.jitter.share
            self._nack_probability = dds.nack_probability.share
            self._nack_delay_ns = dds.nack_delay.ns
            self._loss_probability = dds.loss_probability.share
            self._loss_probability_busy = dds.loss_probability_busy.share
            self._heartbeat_ns = dds.heartbeat_period.ns

    def receive(
        self, size: int, transit_ns: int, timeline: Timeline, *, reliable: bool = True
    ) -> Generator[Awaitable, object, bool]:
        """Return when a message of `size` bytes has come through the stack.

        It left when its timeline started and was in the real network for `transit_ns`. False: a fragment of
        it was lost, and without reliability nobody sends it again.
        """
        if not self._modelled:
            timeline.mark("transport")
            return True
        large = size > self._large_from
        known_ns = min(max(0, transit_ns), self._link_ns(size))
        self._transit_ns[large] += (known_ns - self._transit_ns[large]) / _TRANSITS_REMEMBERED
        yield from self._until(timeline.started_ns + self._link_ns(size))
        timeline.mark("transport")
        probability = self._loss_probability_busy if self._cpu.is_busy else self._loss_probability
        yield from self._process("in", size, self._receive_ns_per_byte)
        timeline.mark("dds")
        return not large or (yield from self._repair(size, timeline, probability, reliable=reliable))

    def send(self, size: int, timeline: Timeline) -> Generator[Awaitable, object, None]:
        """Return when a message of `size` bytes has gone through the stack and over the link."""
        if not self._modelled:
            timeline.mark("dds")
            return
        yield from self._process("out", size, self._send_ns_per_byte)
        timeline.mark("dds")
        arrives_ns = self._environment.now + self._link_ns(size)
        yield from self._until(arrives_ns - round(self._transit_ns[size > self._large_from]))
        timeline.mark("transport")

    def _link_ns(self, size: int) -> int:
        return self._latency_ns + round(size * self._link_ns_per_byte)

    def _until(self, time_ns: int) -> Generator[Awaitable, object, None]:
        if time_ns > self._environment.now:
            yield self._environment.timeout(time_ns - self._environment.now)

    def _process(self, way: str, size: int, ns_per_byte_large: float) -> Generator[Awaitable, object, None]:
        """Return when the stack has worked on a message of `size` bytes."""
        ns_per_byte = ns_per_byte_large if size > self._large_from else self._ns_per_byte
        duration_ns = self._message_ns + size * ns_per_byte
        if self._jitter:
            duration_ns *= self._randomness.lognormvariate(0, self._jitter)
        passage = _Passage(way, duration_ns, Signal())
        self._passages.put(passage)
        yield passage.done

    def _pass(self, passage: _Passage) -> Generator[Awaitable, object, None]:
        self.busy.begin(passage.way)
        yield from self._cpu.run_stack(passage.duration_ns * self._core_share, self._core_share)
        self.busy.end()
        passage.done.fire()

    def _repair(
        self, size: int, timeline: Timeline, loss_probability: float, *, reliable: bool
    ) -> Generator[Awaitable, object, bool]:
        """Return when no fragment of a large message is missing any more; False when one is for ever."""
        if not reliable:
            lost = self._randomness.random() < loss_probability
            return not lost and self._randomness.random() >= self._nack_probability
        if self._randomness.random() < loss_probability:
            yield self._environment.timeout(round(self._randomness.uniform(0, self._heartbeat_ns)))
            timeline.mark("retransmission")
        while self._randomness.random() < self._nack_probability:
            yield self._environment.timeout(self._nack_delay_ns)
            yield from self._process("in", size, self._receive_ns_per_byte)
            timeline.mark("retransmission")
        return True
