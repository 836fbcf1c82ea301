"""The ends of a node whose messages go through the communication stack of a board."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

from reconros_zenoh.board.clients import ClientSource
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.errors import TransportError
from reconros_zenoh.ros.names import resolve

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.sources import Event, Source
    from reconros_zenoh.errors import BadMessageError
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.rmw.received import Responder
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.ros.types import MessageType, ServiceType
    from reconros_zenoh.transport.base import Parts

_Begin: TypeAlias = "Callable[[Callable[[Timeline], object]], None]"
"""Has the event loop send something, with a timeline that begins then; callable from any thread."""


class StackNode:
    """A node's ends on a board, made of the sources and writers of callbacks: each message costs the stack.

    Sinks get an `Event` and are called by the event loop; what sends may be called from any thread. What is
    sent is counted in the board's spans under the absolute name of `whole`, what the ends belong to: an
    action, or `~`, the node itself. Callbacks have no such names.
    """

    def __init__(self, board: Board, node: Node, whole: str) -> None:
        self._board = board
        self._node = node
        self._label = resolve(whole, node.namespace, node.name)
        self.context = node.context
        self.fully_qualified_name = node.fully_qualified_name

    def publisher(self, message_type: MessageType, topic: str, qos: QosProfile) -> _Publisher:
        """Return a new publisher."""
        return _Publisher(self._begin, TopicWriter(self._board, self._node, message_type, topic, qos))

    def subscription(
        self, message_type: MessageType, topic: str, sink: Callable[[Event], None], qos: QosProfile
    ) -> None:
        """Have the messages of a topic handed to `sink`."""
        _hand_over(SubscriptionSource(self._board, self._node, message_type, topic, qos), sink)

    def service(self, service_type: ServiceType, name: str, sink: Callable[[Event], None]) -> None:
        """Have the requests of a service handed to `sink`."""
        source = ServiceSource(self._board, self._node, service_type, name)

        def answerable(event: Event) -> None:
            assert event.responder is not None
            sink(event._replace(responder=_Responder(self._begin, source, event.responder)))

        _hand_over(source, answerable)

    def client(
        self, service_type: ServiceType, name: str, on_matching: Callable[[bool], None] | None = None
    ) -> _Client:
        """Return a new service client; `on_matching` as in `Transport.request`."""
        return _Client(self._begin, ClientSource(self._board, self._node, service_type, name, on_matching))

    def _begin(self, send: Callable[[Timeline], object]) -> None:
        self._board.environment.post(self._send, send)

    def _send(self, send: Callable[[Timeline], object]) -> None:
        timeline = Timeline(self._board.environment, self._board.environment.now)
        timeline.callback = self._label
        send(timeline)


def _hand_over(source: Source, sink: Callable[[Event], None]) -> None:
    """Let the sink have each event as soon as it comes."""
    source.open(lambda: sink(source.take()))


@dataclass(frozen=True, slots=True)
class _Publisher:
    begin: _Begin
    writer: TopicWriter

    def publish(self, message: object) -> None:
        """Publish the message; raises UsageError when it is not of the topic's type."""
        self.begin(partial(self.writer.send, self.writer.encode(message)))


@dataclass(frozen=True, slots=True)
class _Responder:
    begin: _Begin
    source: ServiceSource
    responder: Responder

    def respond_encoded(self, parts: Parts) -> None:
        self.begin(partial(self.source.send, parts, self.responder))

    def fail(self, text: str) -> None:
        self.responder.fail(text)


class _Client:
    def __init__(self, begin: _Begin, source: ClientSource) -> None:
        self._begin = begin
        self._source = source
        self._waiting: dict[int, Callable[[Any], None]] = {}
        _hand_over(source, self._on_event)

    def call(
        self,
        request: object,
        on_response: Callable[[Any | BadMessageError | TransportError], None],
        timeout_ns: int,
    ) -> None:
        """Call the service, as `Client.call`; `on_response` is called by the event loop."""
        parts, number = self._source.encode(request), self._source.next_sequence_number()
        self._waiting[number] = on_response
        self._begin(partial(self._source.send, parts, number, timeout_ns=timeout_ns))

    def _on_event(self, event: Event) -> None:
        assert event.sequence_number is not None
        on_response = self._waiting.pop(event.sequence_number)
        on_response(TransportError("no answer, see the log") if event.message is None else event.message)
