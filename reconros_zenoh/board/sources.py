"""What makes callbacks of a board ready: timers, subscriptions, service servers, and the base of others."""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from reconros_zenoh.board.serial_queue import SerialQueue
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import Writer
from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.ros.qos import QosProfile, Reliability

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import simpy

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.gateway.filters import PublisherFilter
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.rmw.received import Received, Responder
    from reconros_zenoh.ros.types import MessageType, ServiceType
    from reconros_zenoh.transport.base import Parts


def _nobody() -> None:
    """Hear of events before there is a callback."""


class Event(NamedTuple):
    """What a worker takes: the message of the callback (None for a timer) and its timeline so far.

    `message_type` is None for what has no place in memory as a C struct. `in_slot`: it came over a
    hardware-mapped topic, so a slot need not read it from main memory. `size` is that of a subscription's
    message in bytes on the wire, `publisher` the gid of who sent it, `sequence_number` that of the call which
    a response, or its absence, belongs to. `lasting`: how long its callback takes depends on other events, as
    that of a goal on being canceled.
    """

    message: Any
    timeline: Timeline
    responder: Responder | None = None
    message_type: MessageType | None = None
    in_slot: bool = False
    size: int = 0
    publisher: bytes = b""
    sequence_number: int | None = None
    lasting: bool = False


class Source:
    """What makes a callback ready: a queue of events, the last `depth` of them (None: all).

    `kind` is that of its callbacks, None where it may be any; `message_type` as in its events; `checks` says
    whether there is anything that a callback's `check` could refuse.
    """

    kind: CallbackKind | None = None
    message_type: MessageType | None = None
    checks = True

    def __init__(self, depth: int | None = None) -> None:
        self._queue: deque[Event] = deque(maxlen=depth)
        self._dropped = 0
        self._on_ready: Callable[[], None] = _nobody
        self._check: Callable[[Any], None] | None = None
        self.in_hardware = False

    @property
    def dropped(self) -> int:
        """How many events were lost, or pushed out by newer ones, before a worker took them."""
        return self._dropped

    def open(
        self,
        on_ready: Callable[[], None],
        check: Callable[[Any], None] | None = None,
        *,
        in_hardware: bool = False,
    ) -> None:
        """Begin; `on_ready` is called by the event loop whenever an event has come.

        `check` raises BadMessageError for a message that the callback cannot use. `in_hardware` says that
        its callback may run in slots. Raises UsageError the second time: a source makes one callback ready.
        """
        if self._on_ready is not _nobody:
            raise UsageError("one source cannot make two callbacks ready. Give each a source of its own.")
        self._on_ready = on_ready
        self._check = check
        self.in_hardware = in_hardware
        self.begin()

    def begin(self) -> None:
        """Have events come from now on: what a source does when it is opened."""

    def is_ready(self) -> bool:
        """Tell whether an event waits."""
        return bool(self._queue)

    def take(self) -> Event:
        """Remove the oldest event and return it."""
        event = self._queue.popleft()
        event.timeline.mark("queue")
        return event

    def answer(self, event: Event, response: object) -> None:
        """Pass on what the callback returned: nowhere, unless a source says otherwise."""

    def fail(self, event: Event, text: str) -> None:
        """Tell whoever waits for an answer that there is none, and why: nobody, as with `answer`."""

    def enqueue(self, event: Event) -> None:
        """Append an event; called by the event loop."""
        if len(self._queue) == self._queue.maxlen:
            self._dropped += 1
        self._queue.append(event)
        self._on_ready()


_Way: TypeAlias = "Generator[Awaitable, object, bool]"
"""Of a message to the queue of its reader; returns whether it got there."""


class Reader(Source):
    """Messages that come through the communication stack: base of subscriptions, servers and clients.

    It keeps the last `depth` messages (KEEP_LAST) or all (KEEP_ALL), and counts in `dropped` what it pushed
    out or, with best effort, lost.
    """

    message_type: MessageType

    def __init__(self, board: Board, message_type: MessageType, qos: QosProfile) -> None:
        super().__init__(qos.queue_depth)
        self._board = board
        self.message_type = message_type
        self._reliable = qos.reliability is Reliability.RELIABLE
        self._incoming: SerialQueue[tuple[Received, Timeline, _Way]] = SerialQueue(
            self._receive, qos.queue_depth
        )

    @property
    def dropped(self) -> int:
        """How many messages were pushed out by newer ones or lost."""
        return super().dropped + self._incoming.dropped

    def arrive(self, received: Received) -> None:
        """Accept a message from the transport; callable from any thread."""
        self._board.environment.post(self._enter, received)

    def _enter(self, received: Received) -> None:
        environment = self._board.environment
        timeline = Timeline(environment, environment.now - received.transit_ns)
        way = self._board.dds.receive(received.size, received.transit_ns, timeline, reliable=self._reliable)
        self._incoming.put((received, timeline, way))

    def _receive(self, incoming: tuple[Received, Timeline, _Way]) -> Generator[Awaitable, object, None]:
        received, timeline, way = incoming
        if (yield from way):
            self.enqueue(
                Event(
                    received.message,
                    timeline,
                    received.responder,
                    self.message_type,
                    size=received.size,
                    publisher=received.publisher,
                    sequence_number=received.sequence_number,
                )
            )
        else:
            self._dropped += 1


class SubscriptionSource(Reader):
    """A subscription: ready while a message waits.

    It discards what `own` does not let pass.
    """

    kind = CallbackKind.SUB

    def __init__(
        self,
        board: Board,
        node: Node,
        message_type: MessageType,
        topic: str,
        qos: QosProfile | None = None,
        *,
        own: PublisherFilter | None = None,
    ) -> None:
        self.qos = QosProfile.or_default(qos)
        super().__init__(board, message_type, self.qos)
        self._own = own
        self._node = node
        self._topic = topic

    def begin(self) -> None:
        """Subscribe."""
        subscription = self._node.subscription(
            self.message_type, self._topic, self.arrive, self.qos, self._check
        )
        if self._board.topics is not None:
            self._board.topics.add_reader(subscription.key, self)

    def arrive(self, received: Received) -> None:
        """Accept a message from the transport; callable from any thread."""
        topics = self._board.topics
        # What this board publishes comes back from the network, too, where somebody else reads it.
        if topics is not None and received.publisher in topics.publishers:
            return
        if self._own is None or self._own.passes(received.publisher):
            self._board.environment.post(self._enter, received)

    def deliver(self, received: Received, timeline: Timeline, way: _Way) -> None:
        """Accept a message from this board once it has gone its way."""
        if self._own is not None and not self._own.passes(received.publisher):
            return
        try:
            if self._check is not None:
                self._check(received.message)
        except BadMessageError as error:
            self._board.context.rejections.add(self._topic, received.publisher, error)
            return
        self._incoming.put((received, timeline, way))


class ServiceSource(Reader):
    """A service server: ready while a request waits."""

    kind = CallbackKind.SRV

    def __init__(self, board: Board, node: Node, service_type: ServiceType, name: str) -> None:
        super().__init__(board, service_type.request, QosProfile())
        self._node = node
        self._type = service_type
        self._name = name
        self._writer = Writer(board, QosProfile())

    def begin(self) -> None:
        """Serve."""
        self._node.service(self._type, self._name, self.arrive, self._check)

    def answer(self, event: Event, response: object) -> None:
        """Send the response to the client."""
        assert event.responder is not None
        self.send(self._type.response.encode(response), event.responder, event.timeline)

    def send(self, parts: Parts, responder: Responder, timeline: Timeline) -> None:
        """Send an encoded response."""
        self._writer.put(parts, timeline, partial(responder.respond_encoded, parts))

    def fail(self, event: Event, text: str) -> None:
        """Tell the client that there will be no response, and why."""
        assert event.responder is not None
        event.responder.fail(text)


class TimerSource(Source):
    """A periodic timer on the board's clock.

    Expiries that nobody took before the next are one, as in rcl; the others count in `dropped`.
    """

    kind = CallbackKind.TMR
    checks = False

    def __init__(self, board: Board, period_ns: int) -> None:
        super().__init__()
        self._board = board
        self._period_ns = period_ns

    def begin(self) -> None:
        """Let the first period begin."""
        self._board.environment.process(self._run())

    def _run(self) -> Generator[simpy.Event, object, None]:
        environment = self._board.environment
        while True:
            yield environment.timeout(self._period_ns)
            if self._queue:
                self._dropped += 1
            else:
                self.enqueue(Event(None, Timeline(environment, environment.now)))
