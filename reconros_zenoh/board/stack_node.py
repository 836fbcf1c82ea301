"""The ends of a node whose messages go through the communication stack of a board."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from reconros_zenoh.board.clients import UNSENT
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.stream import Stream
from reconros_zenoh.board.writers import Writer
from reconros_zenoh.errors import TransportError
from reconros_zenoh.rmw.received import Received
from reconros_zenoh.ros.names import resolve
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.errors import BadMessageError
    from reconros_zenoh.rmw.client import Client
    from reconros_zenoh.rmw.node import Context, Node
    from reconros_zenoh.rmw.publisher import Publisher
    from reconros_zenoh.rmw.received import Responder
    from reconros_zenoh.ros.types import MessageType, ServiceType
    from reconros_zenoh.transport.base import Parts


class Arrived(NamedTuple):
    """A message that has come through the stack: a `Received` with its timeline so far."""

    message: Any
    size: int
    transit_ns: int
    responder: Responder | None
    publisher: bytes
    timeline: Timeline


class StackNode:
    """A node's ends on a board: like those of `Node`, but each message costs what the stack takes.

    Sinks are called by the event loop; what sends may be called from any thread. What is sent is counted in
    the board's spans under the absolute name of `whole`, what the ends belong to: an action, or `~`, the node
    itself. Callbacks have no such names.
    """

    def __init__(self, board: Board, node: Node, whole: str) -> None:
        self._board = board
        self._node = node
        self._label = resolve(whole, node.namespace, node.name)

    @property
    def context(self) -> Context:
        """The session of the node."""
        return self._node.context

    @property
    def fully_qualified_name(self) -> str:
        """The name of the node behind its namespace."""
        return self._node.fully_qualified_name

    def publisher(self, message_type: MessageType, topic: str, qos: QosProfile) -> StackPublisher:
        """Return a new publisher."""
        publisher = self._node.publisher(message_type, topic, qos)
        return StackPublisher(publisher, _StackWriter(self._board, qos, self._label))

    def subscription(
        self, message_type: MessageType, topic: str, sink: Callable[[Arrived], None], qos: QosProfile
    ) -> None:
        """Have the messages of a topic handed to `sink`."""
        arrivals = Arrivals(self._board, sink, qos.depth, self._label)
        self._node.subscription(message_type, topic, arrivals.accept, qos)

    def service(self, service_type: ServiceType, name: str, sink: Callable[[Arrived], None]) -> None:
        """Have the requests of a service handed to `sink`."""
        writer = _StackWriter(self._board, QosProfile(), self._label)

        def answerable(arrived: Arrived) -> None:
            assert arrived.responder is not None
            sink(arrived._replace(responder=_StackResponder(writer, arrived.responder)))

        arrivals = Arrivals(self._board, answerable, QosProfile().depth, self._label)
        self._node.service(service_type, name, arrivals.accept)

    def client(
        self, service_type: ServiceType, name: str, on_matching: Callable[[bool], None] | None = None
    ) -> StackClient:
        """Return a new service client; `on_matching` as in `Transport.request`."""
        return StackClient(self._board, self._node.client(service_type, name, on_matching), self._label)


class Arrivals:
    """Takes messages through the stack in order and hands them to `sink`; KEEP_LAST of `depth`."""

    def __init__(self, board: Board, sink: Callable[[Arrived], None], depth: int, label: str) -> None:
        self._board = board
        self._sink = sink
        self._label = label
        self._stream: Stream[Arrived] = Stream(self._receive, depth)

    def accept(self, received: Received) -> None:
        """Accept a message from the transport; callable from any thread."""
        self._board.environment.post(self._enter, received)

    def _enter(self, received: Received) -> None:
        environment = self._board.environment
        timeline = Timeline(environment, environment.now - received.transit_ns)
        timeline.callback = self._label
        self._stream.put(
            Arrived(
                received.message,
                received.size,
                received.transit_ns,
                received.responder,
                received.publisher,
                timeline,
            )
        )

    def _receive(self, arrived: Arrived) -> Generator[Awaitable, object, None]:
        yield from self._board.dds.receive(arrived.size, arrived.transit_ns, arrived.timeline)
        self._sink(arrived)


class StackPublisher:
    """A publisher whose messages go through the stack."""

    def __init__(self, publisher: Publisher, writer: _StackWriter) -> None:
        self._publisher = publisher
        self._writer = writer

    def publish(self, message: object) -> None:
        """Publish the message; raises UsageError when it is not of the topic's type."""
        parts = self._publisher.message_type.encode(message)
        self._writer.put(parts, partial(self._publisher.publish_encoded, parts))


class StackClient:
    """A service client whose requests and responses go through the stack."""

    def __init__(self, board: Board, client: Client, label: str) -> None:
        self._board = board
        self._client = client
        self._writer = _StackWriter(board, QosProfile(), label)
        self._label = label

    def call(
        self,
        request: object,
        on_response: Callable[[Any | BadMessageError | TransportError], None],
        timeout_ns: int,
    ) -> None:
        """Call the service, as `Client.call`; `on_response` is called by the event loop."""
        parts = self._client.service_type.request.encode(request)
        arrivals = Arrivals(self._board, lambda arrived: on_response(arrived.message), 1, self._label)

        def on_received(received: Received | BadMessageError | TransportError) -> None:
            if isinstance(received, Received):
                arrivals.accept(received)
            else:
                self._board.environment.post(on_response, received)

        send = partial(self._client.call_encoded, parts, on_received, timeout_ns)
        unsent = partial(on_received, TransportError(UNSENT))
        self._writer.put(parts, send, unsent)


@dataclass(frozen=True, slots=True)
class _StackResponder:
    """Sends a response through the stack."""

    writer: _StackWriter
    responder: Responder

    def respond_encoded(self, parts: Parts) -> None:
        self.writer.put(parts, partial(self.responder.respond_encoded, parts))

    def fail(self, text: str) -> None:
        self.responder.fail(text)


class _StackWriter:
    """A `Writer` for any thread, whose messages begin here and are counted under `label`."""

    def __init__(self, board: Board, qos: QosProfile, label: str) -> None:
        self._environment = board.environment
        self._writer = Writer(board, qos)
        self._label = label

    def put(
        self, parts: Parts, send: Callable[[], None], on_dropped: Callable[[], object] = lambda: None
    ) -> None:
        self._environment.post(self._put, parts, send, on_dropped)

    def _put(self, parts: Parts, send: Callable[[], None], on_dropped: Callable[[], object]) -> None:
        timeline = Timeline(self._environment, self._environment.now)
        timeline.callback = self._label
        self._writer.put(parts, timeline, send, on_dropped)
