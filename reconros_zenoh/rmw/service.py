"""Service servers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.rmw.endpoint import Endpoint
from reconros_zenoh.rmw.received import Received
from reconros_zenoh.ros.attachment import Attachment
from reconros_zenoh.ros.graph import EndpointKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.node import Context, Node
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.ros.types import ServiceType
    from reconros_zenoh.transport.base import Parts, Request


class _Response:
    """The way back of one request: the response carries the request's number and gid and a new timestamp."""

    def __init__(self, context: Context, request: Request, attachment: Attachment) -> None:
        self._context = context
        self._request = request
        self._attachment = attachment

    def respond_encoded(self, parts: Parts) -> None:
        stamped = self._attachment._replace(source_timestamp_ns=self._context.clock_ns())
        self._request.reply(parts, stamped.encode())

    def fail(self, text: str) -> None:
        self._request.reply_error(text)


class Service(Endpoint):
    """Hands the requests of one service to `sink`, decoded, on a thread of the transport.

    A bad request is counted and logged by the context, and its sender gets an error reply that says why.
    `check` is as for a Subscription. A request in another domain, or for another version of the type, is a
    bad one, too, if nobody serves it and its sender asks not only complete servers, as ROS 2 clients do.
    """

    def __init__(
        self,
        node: Node,
        service_type: ServiceType,
        name: str,
        qos: QosProfile,
        sink: Callable[[Received], None],
        check: Callable[[Any], None] | None,
    ) -> None:
        super().__init__(node, EndpointKind.SERVICE, name, service_type, qos)
        self.service_type = service_type
        self._sink = sink
        self._check = check
        transport = self.context.transport
        self.announce(
            transport.serve(self.key, self._on_request),
            transport.serve(self.open_key, self._on_foreign_request, complete=False),
        )

    def _on_request(self, request: Request) -> None:
        sender = None
        try:
            attachment = Attachment.decode(request.attachment)
            sender = attachment.gid
            payload = request.read()
            message = self.service_type.request.decode(payload)
            if self._check is not None:
                self._check(message)
        except BadMessageError as error:
            self._refuse(request, sender, error)
            return
        transit_ns = self.context.clock_ns() - attachment.source_timestamp_ns
        response = _Response(self.context, request, attachment)
        self._sink(Received(message, len(payload), transit_ns, response, attachment.gid))

    def _on_foreign_request(self, request: Request) -> None:
        if request.key != self.key and "*" not in request.key:  # else the other queryable has it, too
            self._refuse(request, None, self.foreign(request.key))

    def _refuse(self, request: Request, sender: bytes | None, error: BadMessageError) -> None:
        self.context.rejections.add(request.key, sender, error)
        request.reply_error(str(error))
