"""What every endpoint of a node has: a key, a graph token, a gid, and numbered messages."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.ros.attachment import Attachment
from reconros_zenoh.ros.graph import EndpointToken, gid
from reconros_zenoh.ros.names import data_key, resolve

if TYPE_CHECKING:
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.graph import EndpointKind
    from reconros_zenoh.ros.qos import QosProfile
    from reconros_zenoh.ros.types import MessageType, ServiceType
    from reconros_zenoh.transport.base import Declaration


class Endpoint:
    """One end of a topic or service, announced in the ROS graph until it is closed."""

    def __init__(
        self, node: Node, kind: EndpointKind, name: str, interface: MessageType | ServiceType, qos: QosProfile
    ) -> None:
        context = node.context
        self.context = context
        self._node = node
        self.name = resolve(name, node.namespace, node.name)
        self.key = data_key(context.domain, self.name, interface.dds_name, interface.type_hash)
        self._token_key = EndpointToken(
            context.domain,
            context.transport.session_id,
            node.node_id,
            context.next_id(),
            kind,
            node.namespace,
            node.name,
            self.name,
            interface.dds_name,
            interface.type_hash,
            qos,
        ).format()
        self.gid = gid(self._token_key)
        self.next_sequence_number = itertools.count(1).__next__
        """Return the number of the endpoint's next message; callable from any thread."""

    @property
    def open_key(self) -> str:
        """The key expression that leaves domain and type hash open."""
        return "/".join(("*", *self.key.split("/")[1:-1], "*"))

    def foreign(self, key: str) -> BadMessageError:
        """Say what is wrong with a message on `key`, which matches the open key only."""
        domain, own_domain = key.split("/", 1)[0], self.key.split("/", 1)[0]
        if domain != own_domain:
            return BadMessageError(
                "foreign_domain", f"it was sent in domain {domain}, this is domain {own_domain}"
            )
        type_hash, own_hash = key.rsplit("/", 1)[1], self.key.rsplit("/", 1)[1]
        return BadMessageError("type_mismatch", f"the sender's type has hash {type_hash}, ours {own_hash}")

    def announce(self, *declarations: Declaration) -> None:
        """Make the endpoint visible in the graph, once it works; from then on its node closes it, too."""
        self._declarations = declarations
        self._token = self.context.transport.declare_token(self._token_key)
        self._node.endpoints[self] = None

    def close(self) -> None:
        """Take it out of the graph and end it for good; its callbacks are not called any more. Idempotent."""
        self._node.endpoints.pop(self, None)
        self._token.close()
        for declaration in self._declarations:
            declaration.close()

    def attachment(self, sequence_number: int) -> bytes:
        """Return the attachment of the message of that number, stamped now."""
        return Attachment(sequence_number, self.context.clock_ns(), self.gid).encode()
