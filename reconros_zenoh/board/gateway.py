"""A gateway on a board: the core of `reconros_zenoh.gateway` in the model, with its delegate and its ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.board.hmt import Fifo, FifoPlan
from reconros_zenoh.board.sources import SubscriptionSource
from reconros_zenoh.clock.activity import Activity, Signal
from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.gateway import core
from reconros_zenoh.gateway.filters import Pair, PublisherFilter

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.bitstream import Bitstream
    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.hmt import HardwareTopic
    from reconros_zenoh.board.slots import Slot
    from reconros_zenoh.board.sources import Event
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.qos import QosProfile


class Gateway:
    """Keeps a software-mapped and a hardware-mapped topic of one name each alike, until it is closed.

    Whatever the number of subscribers, a message crosses the MEMIF once. Towards the HMT it is read from
    memory and streamed at the same time; from the HMT it is written as its words come in. What comes before
    the slot holds the gateway waits for it. Source: Gateways, Section 3.
    """

    def __init__(
        self,
        board: Board,
        node: Node,
        topic: HardwareTopic,
        smt: str,
        qos: QosProfile,
        slot: Slot,
        bitstream: Bitstream,
    ) -> None:
        model = board.profile.model
        self._board = board
        self._node = node
        self._topic = topic
        self._cancel_ns = model.gateway.cancel.ns if model and model.gateway else 0
        self._woken = Signal()
        self._smt_last = False
        self._writer = board.writer(node, topic.type, smt, qos, in_place=True)
        self._smt = SubscriptionSource(
            board, node, topic.type, smt, qos, own=PublisherFilter(self._writer.gid)
        )
        self._hmt = Fifo(FifoPlan(), self._wake, PublisherFilter(self), cut_through=True)
        self._track = slot.track
        self.name = node.name
        self._label = node.fully_qualified_name
        self.pair = Pair(topic.key, self._writer.topic)
        self.type = topic.type.name
        self.qos = qos
        self.slot_id = slot.slot_id
        self.to_hmt = 0
        self.to_smt = 0
        self.late = 0
        self.refused = 0
        topic.subscribe(self._hmt)
        self._smt.open(self._wake, in_hardware=True)
        Activity(self._run(slot, bitstream))

    @property
    def dropped(self) -> int:
        """How many messages from the SMT were pushed out by newer ones; those to it are its publisher's."""
        return self._smt.dropped

    def close(self) -> None:
        """Take the gateway out of the graph."""
        self._node.close()

    def _wake(self) -> None:
        woken, self._woken = self._woken, Signal()
        woken.fire()

    def _run(self, slot: Slot, bitstream: Bitstream) -> Generator[Awaitable, object, None]:
        yield from self._board.zycap.write_bitstream(slot, bitstream)
        state, action = core.step(core.State(), core.Started())
        while True:
            # While its request stands the core waits for messages.
            track = None if isinstance(action, core.Request) else self._track
            if track:
                track.begin(self.name)
            event = yield from self._carry_out(action)
            if track:
                track.end()
            state, action = core.step(state, event)

    def _carry_out(self, action: core.Action) -> Generator[Awaitable, object, core.Event]:
        """Return what comes of the action; of a request, the first thing that the core then polls."""
        match action:
            case core.Request():
                yield from self._board.osif.call()
                return (yield from self._poll())
            case core.WriteHmt(event):
                yield from self._write_hmt(event)
                return core.Transferred()
            case core.WriteMemory(streamed):
                yield from self._board.memif.transfer(streamed.size)
                yield streamed.complete
                streamed.timeline.mark("hmt")
                return core.Transferred()
            case core.Cancel():
                yield from self._board.cpu.run(self._cancel_ns)
                late = self._smt.take() if self._smt.is_ready() else None
                self.late += late is not None
                return core.Cancelled(late)
            case core.Publish(streamed):
                streamed.timeline.mark("gateway")
                self.to_smt += 1
                yield from self._writer.publish(streamed.message, streamed.timeline)
                return core.Published()

    def _poll(self) -> Generator[Awaitable, object, core.Event]:
        """Return what has come; when both sides have a message, they take turns."""
        while not (self._smt.is_ready() or self._hmt.messages):
            yield self._woken
        self._smt_last = self._smt.is_ready() and not (self._hmt.messages and self._smt_last)
        if self._smt_last:
            return core.Responded(self._smt.take())
        streamed = self._hmt.take()
        streamed.timeline.callback = self._label
        return core.Arrived(streamed)

    def _write_hmt(self, event: Event) -> Generator[Awaitable, object, None]:
        event.timeline.callback = self._label
        event.timeline.mark("gateway")
        read = Signal()
        Activity(self._read(event.size, read))
        try:
            yield from self._topic.publish(
                self, event.message, event.size, event.timeline, event.publisher, read
            )
            self.to_hmt += 1
        except BadMessageError as error:
            self.refused += 1
            self._board.context.rejections.add(self._topic.key, event.publisher, error)
        yield read

    def _read(self, size: int, done: Signal) -> Generator[Awaitable, object, None]:
        yield from self._board.memif.transfer(size)
        done.fire()
