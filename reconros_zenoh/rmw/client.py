"""Service clients."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import BadMessageError, TransportError
from reconros_zenoh.rmw.endpoint import Endpoint
from reconros_zenoh.rmw.received import Received
from reconros_zenoh.ros.attachment import Attachment
from reconros_zenoh.ros.graph import EndpointKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.ros.types import ServiceType
    from reconros_zenoh.transport.base import Parts, Reply


class Client(Endpoint):
    """Calls one service."""

    def __init__(
        self,
        node: Node,
        service_type: ServiceType,
        name: str,
        qos: QosProfile,
        on_matching: Callable[[bool], None] | None,
    ) -> None:
        super().__init__(node, EndpointKind.CLIENT, name, service_type, qos)
        self.service_type = service_type
        self._querier = self.context.transport.request(self.key, on_matching)
        self.announce(self._querier)

    def call(
        self,
        request: object,
        on_response: Callable[[Any | BadMessageError | TransportError], None],
        timeout_ns: int,
    ) -> None:
        """Call the service; `on_response` gets the response once, on a thread of the transport.

        It gets a TransportError when the server refused or nobody answered within `timeout_ns`, and a
        BadMessageError when the response cannot be decoded.
        """

        def on_received(received: Received | BadMessageError | TransportError) -> None:
            on_response(received.message if isinstance(received, Received) else received)

        parts = self.service_type.request.encode(request, joined_at_once=True)
        self.call_encoded(parts, on_received, timeout_ns)

    def call_encoded(
        self,
        parts: Parts,
        on_received: Callable[[Received | BadMessageError | TransportError], None],
        timeout_ns: int,
        sequence_number: int | None = None,
    ) -> None:
        """Call the service like `call` with a request that is encoded already.

        `sequence_number` is what `next_sequence_number` has returned for this call; the response has it.
        """
        number = self.next_sequence_number() if sequence_number is None else sequence_number
        answered = False

        def on_reply(reply: Reply | None) -> None:
            nonlocal answered
            if answered:
                return
            answered = True
            on_received(self._result(reply, number))

        try:
            self._querier.get(parts, self.attachment(number), on_reply, timeout_ns)
        except TransportError:
            if not answered:  # Zenoh may say that the request is over, and then that it cannot be sent
                answered = True
                raise

    def _result(self, reply: Reply | None, number: int) -> Received | BadMessageError | TransportError:
        if reply is None:
            return TransportError(f"no answer from service {self.name}")
        if reply.payload is None:
            return TransportError(f"service {self.name} refused: {reply.error}")
        try:
            message = self.service_type.response.decode(reply.payload)
            now_ns = self.context.clock_ns()
            sent_ns = Attachment.decode(reply.attachment).source_timestamp_ns if reply.attachment else now_ns
        except BadMessageError as error:
            self.context.rejections.add(self.key, None, error)
            return error
        return Received(message, len(reply.payload), now_ns - sent_ns, sequence_number=number)
