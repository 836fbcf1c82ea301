"""Publishers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.rmw.endpoint import Endpoint
from reconros_zenoh.ros.graph import EndpointKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.ros.types import MessageType
    from reconros_zenoh.transport.base import Parts


class Publisher(Endpoint):
    """Publishes messages of one type on one topic."""

    def __init__(
        self,
        node: Node,
        message_type: MessageType,
        topic: str,
        qos: QosProfile,
        on_matching: Callable[[bool], None] | None,
    ) -> None:
        super().__init__(node, EndpointKind.PUBLISHER, topic, message_type, qos)
        self.message_type = message_type
        self._publisher = self.context.transport.publish(self.key, qos, on_matching)
        self.announce(self._publisher)

    def publish(self, message: object) -> None:
        """Publish the message."""
        self.publish_encoded(self.message_type.encode(message, joined_at_once=True))

    def publish_encoded(self, parts: Parts) -> None:
        """Publish a message that is encoded already, as `message_type.encode` does."""
        self._publisher.put(parts, self.attachment(self.next_sequence_number()))
