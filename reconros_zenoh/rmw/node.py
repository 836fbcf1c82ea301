"""A process's part of the ROS graph: its context and the nodes in it."""

from __future__ import annotations

import itertools
import time
from typing import TYPE_CHECKING, Any

from reconros_zenoh.rmw.client import Client
from reconros_zenoh.rmw.publisher import Publisher
from reconros_zenoh.rmw.rejections import Rejections
from reconros_zenoh.rmw.service import Service
from reconros_zenoh.rmw.subscription import Subscription
from reconros_zenoh.ros.graph import NodeToken
from reconros_zenoh.ros.names import check_namespace, check_node_name, resolve
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.endpoint import Endpoint
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.types import MessageType, ServiceType
    from reconros_zenoh.transport.base import Transport

_SERVICES = QosProfile()
"""rmw_qos_profile_services_default: reliable, volatile, keep the last 10."""


class Context:
    """One session in one ROS domain; its ids count from 0 as those of rmw_zenoh do.

    `clock_ns` stamps what is sent: nanoseconds since the epoch, in virtual time since the start.
    """

    def __init__(
        self, transport: Transport, domain: int = 0, clock_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self.transport = transport
        self.domain = domain
        self.clock_ns = clock_ns
        self.rejections = Rejections()
        self._ids = itertools.count()

    def next_id(self) -> str:
        """Return the next id of this session."""
        return str(next(self._ids))

    def node(self, name: str, namespace: str = "/") -> Node:
        """Return a new node; raise UsageError when ROS 2 does not allow its name."""
        return Node(self, name, namespace)


class Node:
    """A ROS 2 node; its `endpoints` live until they or the node are closed."""

    def __init__(self, context: Context, name: str, namespace: str) -> None:
        check_node_name(name)
        check_namespace(namespace)
        self.context = context
        self.name = name
        self.namespace = namespace
        self.node_id = context.next_id()
        self.endpoints: dict[Endpoint, None] = {}
        self._token = context.transport.declare_token(
            NodeToken(
                context.domain, context.transport.session_id, self.node_id, self.node_id, namespace, name
            ).format()
        )

    @property
    def fully_qualified_name(self) -> str:
        """The name of the node behind its namespace: `/arm/motor`."""
        return resolve("~", self.namespace, self.name)

    def publisher(
        self,
        message_type: MessageType,
        topic: str,
        qos: QosProfile | None = None,
        on_matching: Callable[[bool], None] | None = None,
    ) -> Publisher:
        """Return a new publisher; `on_matching` as in `Transport.publish`."""
        return Publisher(self, message_type, topic, QosProfile.or_default(qos), on_matching)

    def subscription(
        self,
        message_type: MessageType,
        topic: str,
        sink: Callable[[Received], None],
        qos: QosProfile | None = None,
        check: Callable[[Any], None] | None = None,
    ) -> Subscription:
        """Return a new subscription; see there for `sink` and `check`."""
        return Subscription(self, message_type, topic, QosProfile.or_default(qos), sink, check)

    def service(
        self,
        service_type: ServiceType,
        name: str,
        sink: Callable[[Received], None],
        check: Callable[[Any], None] | None = None,
    ) -> Service:
        """Return a new service server; see there for `sink` and `check`."""
        return Service(self, service_type, name, _SERVICES, sink, check)

    def client(
        self, service_type: ServiceType, name: str, on_matching: Callable[[bool], None] | None = None
    ) -> Client:
        """Return a new service client; `on_matching` as in `Transport.request`."""
        return Client(self, service_type, name, _SERVICES, on_matching)

    def close(self) -> None:
        """Close every endpoint and take the node out of the graph. Idempotent."""
        for endpoint in list(self.endpoints):
            endpoint.close()
        self._token.close()
