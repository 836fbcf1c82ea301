"""Liveliness tokens: what rmw_zenoh knows of the nodes and endpoints of the ROS graph."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import xxhash

from reconros_zenoh.ros.names import demangle, mangle
from reconros_zenoh.ros.qos import QosProfile

_ADMIN_SPACE = "@ros2_lv"


class EndpointKind(Enum):
    """What an endpoint does; the values are those in its token."""

    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVICE = "SS"
    CLIENT = "SC"


@dataclass(frozen=True, slots=True)
class NodeToken:
    """The token of a node; `zid`, `nid` and `id` are opaque, and `nid` equals `id` in a node of rmw_zenoh.

    `namespace` is absolute, `/` for the root, and so is `enclave`.
    """

    domain: int
    zid: str
    nid: str
    id: str
    namespace: str
    node: str
    enclave: str = "/"

    def format(self) -> str:
        """Return the key expression of the token."""
        return "/".join((*_identity(self, "NN"), mangle(self.node)))


@dataclass(frozen=True, slots=True)
class EndpointToken:
    """The token of a publisher, subscription, service server or client.

    `name` is the absolute topic or service name, `dds_type` its type as `names.dds_type_name` gives it.
    `type_hash` of Humble is `TypeHashNotSupported`. `backends` is the optional last part of releases from
    Lyrical on (`backends:cpu:`), else empty.
    """

    domain: int
    zid: str
    nid: str
    id: str
    kind: EndpointKind
    namespace: str
    node: str
    name: str
    dds_type: str
    type_hash: str
    qos: QosProfile
    enclave: str = "/"
    backends: str = ""

    def format(self) -> str:
        """Return the key expression of the token."""
        parts = (
            *_identity(self, self.kind.value),
            mangle(self.node),
            mangle(self.name),
            mangle(self.dds_type),
            mangle(self.type_hash),
            self.qos.encode(),
        )
        return "/".join((*parts, self.backends) if self.backends else parts)


def parse(key: str) -> NodeToken | EndpointToken | None:
    """Return what the token `key` announces, or None when `key` is no token of rmw_zenoh.

    The result need not format to `key` again (a peer may spell a default QoS out), so a gid is always
    taken of the key that was received.
    """
    admin_space, *parts = key.split("/")
    # What is not printable could tell a terminal what to do; no name of ROS 2 has such a character.
    if admin_space != _ADMIN_SPACE or "" in parts or not key.isprintable():
        return None
    try:
        match parts:
            case [domain, zid, nid, own_id, "NN", enclave, namespace, node]:
                return NodeToken(
                    _domain(domain), zid, nid, own_id, demangle(namespace), demangle(node), demangle(enclave)
                )
            case [domain, zid, nid, own_id, kind, enclave, namespace, node, *rest]:
                name, dds_type, type_hash, qos, *backends = rest
                return EndpointToken(
                    _domain(domain),
                    zid,
                    nid,
                    own_id,
                    EndpointKind(kind),
                    demangle(namespace),
                    demangle(node),
                    demangle(name),
                    demangle(dds_type),
                    demangle(type_hash),
                    QosProfile.decode(qos),
                    demangle(enclave),
                    _backends(backends),
                )
    except ValueError:  # too few parts, or one that is not of its form
        pass
    return None


def gid(token: str) -> bytes:
    """Return the 16 bytes by which attachments name the endpoint that has this token.

    They are the low, then the high 64-bit word of its XXH3-128, each little endian.
    """
    return xxhash.xxh3_128(token.encode()).digest()[::-1]


def tokens_expression(domain: int) -> str:
    """Return the key expression that matches every token of a ROS domain."""
    return f"{_ADMIN_SPACE}/{domain}/**"


def _identity(token: NodeToken | EndpointToken, kind: str) -> tuple[str, ...]:
    return (
        _ADMIN_SPACE,
        str(token.domain),
        token.zid,
        token.nid,
        token.id,
        kind,
        mangle(token.enclave),
        mangle(token.namespace),
    )


def _domain(part: str) -> int:
    if not (part.isascii() and part.isdecimal()):
        raise ValueError(f"{part!r} is not a domain")
    return int(part)


def _backends(parts: list[str]) -> str:
    if parts and (len(parts) > 1 or not parts[0].startswith("backends:")):
        raise ValueError(f"{parts} are not backends")
    return "".join(parts)
