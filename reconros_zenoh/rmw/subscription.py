"""Subscriptions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.rmw.endpoint import Endpoint
from reconros_zenoh.rmw.received import Received
from reconros_zenoh.ros.attachment import Attachment
from reconros_zenoh.ros.graph import EndpointKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.ros.types import MessageType
    from reconros_zenoh.transport.base import Sample


class Subscription(Endpoint):
    """Hands the messages of one topic to `sink`, decoded, on a thread of the transport.

    `check`, when given, raises BadMessageError for a message that its receiver cannot use. Bad messages are
    counted and logged by the context; `sink` never sees them. The key expression leaves domain and type hash
    open, so that a publisher in another domain or with another version of the type is noticed rather than
    never heard.
    """

    def __init__(
        self,
        node: Node,
        message_type: MessageType,
        topic: str,
        qos: QosProfile,
        sink: Callable[[Received], None],
        check: Callable[[Any], None] | None,
    ) -> None:
        super().__init__(node, EndpointKind.SUBSCRIPTION, topic, message_type, qos)
        self._type = message_type
        self._sink = sink
        self._check = check
        self.announce(self.context.transport.subscribe(self.open_key, self._on_sample, qos, self.key))

    def _on_sample(self, sample: Sample) -> None:
        key, attachment, payload = sample
        sender = None
        try:
            if key != self.key:
                raise self.foreign(key)
            _, source_timestamp_ns, sender = Attachment.decode(attachment)
            message = self._type.decode(payload)
            if self._check is not None:
                self._check(message)
        except BadMessageError as error:
            self.context.rejections.add(key, sender, error)
            return
        transit_ns = self.context.clock_ns() - source_timestamp_ns
        self._sink(Received(message, len(payload), transit_ns, None, sender))
