"""What actions and parameters need of a node: of a `Node`, or of one that charges a board for messages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.errors import BadMessageError, TransportError
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.ros.types import MessageType, ServiceType


class PublisherEnd(Protocol):
    """A publisher."""

    def publish(self, message: object) -> None:
        """Publish the message."""


class ClientEnd(Protocol):
    """A service client."""

    def call(
        self,
        request: object,
        on_response: Callable[[Any | BadMessageError | TransportError], None],
        timeout_ns: int,
    ) -> None:
        """Call the service, as `Client.call`."""


class NodeEnds(Protocol):
    """Makes the ends of topics and services of one node, as `Node` does; sinks get a `Received` or alike."""

    @property
    def context(self) -> Context:
        """The session of the node."""

    @property
    def fully_qualified_name(self) -> str:
        """The name of the node behind its namespace: `/arm/motor`."""

    def publisher(self, message_type: MessageType, topic: str, qos: QosProfile) -> PublisherEnd:
        """Return a new publisher."""

    def subscription(
        self, message_type: MessageType, topic: str, sink: Callable[[Any], None], qos: QosProfile
    ) -> object:
        """Have the messages of a topic handed to `sink`."""

    def service(self, service_type: ServiceType, name: str, sink: Callable[[Any], None]) -> object:
        """Have the requests of a service handed to `sink`."""

    def client(
        self, service_type: ServiceType, name: str, on_matching: Callable[[bool], None] | None = None
    ) -> ClientEnd:
        """Return a new service client; `on_matching` as in `Transport.request`."""
