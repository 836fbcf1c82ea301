"""Where messages of a board go: publishers, and the way out through the communication stack."""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from reconros_zenoh.board.serial_queue import SerialQueue
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.spans import Timeline
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.types import MessageType
    from reconros_zenoh.transport.base import Parts

_AGES_KEPT = 10_000


class MessageWriter(Protocol):
    """What callbacks publish with, wherever the topic is mapped to."""

    @property
    def in_slot(self) -> bool:
        """Whether messages leave the slot without passing main memory."""

    def message(self, **fields: object) -> Any:
        """Return a message of the topic's type with these fields."""

    def encode(self, message: object) -> Any:
        """Return what `send` takes; callable from any thread."""

    def send(self, encoded: Any, timeline: Timeline) -> None:
        """Publish what `encode` returned: the way of a software callback."""

    def publish(self, message: object, timeline: Timeline) -> Generator[Awaitable, object, None]:
        """Publish the message: the way of a hardware thread, which goes on when this returns."""


class _Outgoing(NamedTuple):
    send: Callable[[], None]
    size: int
    timeline: Timeline
    on_dropped: Callable[[], object] = lambda: None


class Writer:
    """Takes messages through the stack and over the link in order, then sends them: base of publishers.

    With KEEP_LAST at most `depth` wait; a further one pushes the oldest out. `sent` counts what has left,
    `ages_ns` says of the last how old it was then: since the message or timer that it follows from.
    """

    def __init__(self, board: Board, qos: QosProfile) -> None:
        self._board = board
        self.sent = 0
        self.ages_ns: deque[int] = deque(maxlen=_AGES_KEPT)
        self._outgoing: SerialQueue[_Outgoing] = SerialQueue(
            self._leave, qos.queue_depth, lambda lost: lost.on_dropped()
        )

    @property
    def dropped(self) -> int:
        """How many messages were pushed out by newer ones."""
        return self._outgoing.dropped

    def put(
        self,
        parts: Parts,
        timeline: Timeline,
        send: Callable[[], None],
        on_dropped: Callable[[], object] = lambda: None,
    ) -> None:
        """Have `send` called when a message of these parts has gone through the stack and over the link.

        `on_dropped` is called instead, by the event loop, when it is pushed out or cannot be sent.
        """
        self._outgoing.put(_Outgoing(send, sum(map(len, parts)), timeline, on_dropped))

    def _leave(self, outgoing: _Outgoing) -> Generator[Awaitable, object, None]:
        yield from self._board.dds.send(outgoing.size, outgoing.timeline)
        # A large message is copied into the transport: not by the thread that keeps the clock.
        yield from self._board.sending_host.run(self, outgoing.send)
        self._board.spans.add(outgoing.timeline)
        self.sent += 1
        self.ages_ns.append(outgoing.timeline.age_ns)


class TopicWriter(Writer):
    """A publisher of the board."""

    in_slot = False

    def __init__(
        self, board: Board, node: Node, message_type: MessageType, topic: str, qos: QosProfile | None = None
    ) -> None:
        qos = QosProfile.or_default(qos)
        super().__init__(board, qos)
        self._publisher = node.publisher(message_type, topic, qos)
        self.topic = self._publisher.name
        self.key = self._publisher.key
        self.gid = self._publisher.gid

    def message(self, **fields: object) -> Any:
        """Return a message of the topic's type with these fields."""
        return self._publisher.message_type.message(**fields)

    def encode(self, message: object) -> Parts:
        """Return the message as it goes over the wire; callable from any thread."""
        return self._publisher.message_type.encode(message)

    def send(self, encoded: Parts, timeline: Timeline) -> None:
        """Publish an encoded message."""
        self.put(encoded, timeline, partial(self._publisher.publish_encoded, encoded))

    def publish(self, message: object, timeline: Timeline) -> Generator[Awaitable, object, None]:
        """Publish the message through the delegate: ROS_PUBLISHER_PUBLISH."""
        yield from self._board.osif.call()
        timeline.mark("osif")
        self.send(self.encode(message), timeline.fork())
