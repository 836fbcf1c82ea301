"""Software-mapped topics between nodes of one board.

On a real board such a message never sees the network: the publisher's process or delegate hands it to the
readers through main memory. Profiles without a section `[model.topics]` do not know what that costs; there
every message takes the way through stack and link. Source: Gateways, Sections 2.2 and 4; the constants are
fitted to its speedups.
"""

from __future__ import annotations

from collections import defaultdict, deque
from typing import TYPE_CHECKING, Any, NamedTuple

from reconros_zenoh.board.serial_queue import SerialQueue
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.clock.activity import Signal
from reconros_zenoh.rmw.received import Received
from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, parse, tokens_expression
from reconros_zenoh.ros.message_arrays import snapshot
from reconros_zenoh.ros.names import data_key
from reconros_zenoh.ros.qos import Durability, QosProfile

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.profile import Model, TopicsSection
    from reconros_zenoh.board.sources import SubscriptionSource
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.types import MessageType
    from reconros_zenoh.transport.base import Parts


class _Publication(NamedTuple):
    """A message for the readers of the board; `hardware` says where its publisher is.

    `in_place`: the publisher has written it where software readers find it, so they copy nothing. Hardware
    readers then fetch it over the MEMIF themselves.
    """

    received: Received
    hardware: bool
    in_place: bool


class LocalTopics:
    """Who reads which topic on this board, and whether anybody elsewhere does."""

    def __init__(self, board: Board, model: Model, section: TopicsSection) -> None:
        self._board = board
        self._publish_ns = section.publish.ns
        self._notify_ns = section.notify_hardware.ns
        self._notify_software_ns = section.notify_software.ns
        self._copy_in = section.copy_in.ns_per_byte
        self._copy_out = section.copy_out.ns_per_byte
        self._memif_ns_per_byte = 1 / model.memif.bandwidth.bytes_per_ns
        self._readers: defaultdict[str, list[SubscriptionSource]] = defaultdict(list)
        self._writers: defaultdict[str, list[LocalTopicWriter]] = defaultdict(list)
        self._elsewhere: defaultdict[str, set[str]] = defaultdict(set)
        self.publishers: set[bytes] = set()
        context = board.context
        self._watch = context.transport.watch_tokens(
            tokens_expression(context.domain),
            lambda token, alive: board.environment.post(self._on_token, token, alive),
        )

    def add_reader(self, key: str, reader: SubscriptionSource) -> None:
        """Let what is published on this key on the board reach the reader from now on.

        With TRANSIENT_LOCAL it first gets the last `depth` messages of each writer that keeps some. They are
        published already: each costs what waking a hardware reader takes, or its way to a software reader.
        """
        self._readers[key].append(reader)
        if reader.qos.durability is Durability.TRANSIENT_LOCAL:
            for writer in self._writers[key]:
                for publication in deque(writer.kept, reader.qos.depth):
                    timeline = Timeline(self._board.environment, self._board.environment.now)
                    if reader.in_hardware:
                        way = self._work(self._notify_ns, timeline)
                    else:
                        way = self._way_to_software(publication, 0, timeline)
                    reader.deliver(publication.received, timeline, way)

    def add_writer(self, writer: LocalTopicWriter) -> None:
        """Let readers that come later have what the writer keeps, and have its messages from it alone."""
        self._writers[writer.key].append(writer)
        self.publishers.add(writer.gid)

    def is_read_elsewhere(self, key: str) -> bool:
        """Tell whether another session subscribes to the key."""
        return bool(self._elsewhere[key])

    def publish(
        self, key: str, publication: _Publication, timeline: Timeline
    ) -> Generator[Awaitable, object, None]:
        """Return when the publication is over; its readers go on from there."""
        cpu, received = self._board.cpu, publication.received
        readers = self._readers[key]
        woken = sum(reader.in_hardware for reader in readers)
        copy_ns = 0 if publication.hardware else received.size * self._copy_in
        yield from cpu.run(self._publish_ns + copy_ns)
        notify_ns = self._notify_ns if publication.hardware else self._notify_software_ns
        for _ in range(woken):
            yield from cpu.run(notify_ns)
        timeline.mark("dds")
        # What is left of waking the hardware readers is their delegates' work, not the publisher's.
        rest_ns = woken * max(0, self._notify_ns - notify_ns)
        for reader in readers:
            theirs = timeline.follow()
            if reader.in_hardware:
                way = self._wait(rest_ns, theirs)
            else:
                way = self._way_to_software(publication, woken, theirs)
            reader.deliver(received, theirs, way)

    def close(self) -> None:
        """Look at the graph no longer."""
        self._watch.close()

    def _way_to_software(
        self, publication: _Publication, woken: int, timeline: Timeline
    ) -> Generator[Awaitable, object, bool]:
        """Return the way to a software reader beside so many hardware readers of the same message."""
        size = publication.received.size
        if publication.in_place:
            return self._wait(0, timeline)
        if publication.hardware:
            return self._wait(round(size * self._memif_ns_per_byte), timeline)
        return self._work(size * self._copy_out * woken, timeline)

    def _wait(self, duration_ns: int, timeline: Timeline) -> Generator[Awaitable, object, bool]:
        if duration_ns:
            yield self._board.environment.timeout(duration_ns)
            timeline.mark("dds")
        return True

    def _work(self, core_time_ns: float, timeline: Timeline) -> Generator[Awaitable, object, bool]:
        yield from self._board.cpu.run(core_time_ns)
        timeline.mark("dds")
        return True

    def _on_token(self, key: str, alive: bool) -> None:
        token = parse(key)
        if (
            isinstance(token, EndpointToken)
            and token.kind is EndpointKind.SUBSCRIPTION
            and token.zid != self._board.context.transport.session_id
        ):
            tokens = self._elsewhere[data_key(token.domain, token.name, token.dds_type, token.type_hash)]
            (tokens.add if alive else tokens.discard)(key)


class _Sent(NamedTuple):
    """A message for the readers of the board; `over` fires when it is published, or pushed out before."""

    message: Any
    parts: Parts
    timeline: Timeline
    hardware: bool
    over: Signal


class LocalTopicWriter(TopicWriter):
    """A publisher of a board that knows what its own topics cost; stack and link only for readers elsewhere.

    With TRANSIENT_LOCAL every message goes through them, because such a reader may come later; for readers of
    the board that do, the last `depth` are `kept`. All readers get one copy of the message as it was when it
    was published; its arrays are read-only.
    """

    def __init__(
        self,
        board: Board,
        node: Node,
        message_type: MessageType,
        topic: str,
        topics: LocalTopics,
        qos: QosProfile | None = None,
        *,
        in_place: bool = False,
    ) -> None:
        qos = QosProfile.or_default(qos)
        super().__init__(board, node, message_type, topic, qos)
        self._topics = topics
        self._in_place = in_place
        # The transport keeps what is sent for those who come late elsewhere.
        self._is_kept = qos.durability is Durability.TRANSIENT_LOCAL
        # Those of slots, too: a callback that runs here and there publishes in order.
        self._publications: SerialQueue[_Sent] = SerialQueue(
            self._publish, qos.queue_depth, lambda lost: lost.over.fire()
        )
        self.kept: deque[_Publication] = deque(maxlen=qos.depth if self._is_kept else 0)
        topics.add_writer(self)

    @property
    def dropped(self) -> int:
        """How many messages were pushed out by newer ones."""
        return super().dropped + self._publications.dropped

    def encode(self, message: object) -> Any:
        """Return a copy of the message, and how it goes over the wire; callable from any thread."""
        message = snapshot(message)
        return message, super().encode(message)

    def send(self, encoded: Any, timeline: Timeline) -> None:
        """Publish for a software callback."""
        message, parts = encoded
        self._publications.put(_Sent(message, parts, timeline, hardware=False, over=Signal()))

    def publish(self, message: object, timeline: Timeline) -> Generator[Awaitable, object, None]:
        """Return when the delegate has published; its call is part of what a publication costs."""
        message, parts = self.encode(message)
        sent = _Sent(message, parts, timeline.fork(), hardware=True, over=Signal())
        self._publications.put(sent)
        yield sent.over
        timeline.mark("dds")

    def _publish(self, sent: _Sent) -> Generator[Awaitable, object, None]:
        received = Received(sent.message, sum(map(len, sent.parts)), 0, publisher=self.gid)
        publication = _Publication(received, sent.hardware, self._in_place)
        yield from self._topics.publish(self.key, publication, sent.timeline)
        self.kept.append(publication)
        if self._is_kept or self._topics.is_read_elsewhere(self.key):
            super().send(sent.parts, sent.timeline)
        else:
            self._board.spans.add(sent.timeline)
        sent.over.fire()
