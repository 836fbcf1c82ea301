"""The waist of the project: what a transport does, in bytes and attachments.

Who uses a transport sees only this file; which one it is, only those know that open it.

Threads: every method may be called from any thread. Sinks and callbacks run on a thread of the transport, or
within the call that caused them when both ends are in one session (`SimulatedTransport`: as events of its
environment), one at a time for each declaration. They never block: they post. The first exception among those
of a declaration is logged with its key; none harms anything else.
Errors: what a closed transport or declaration is asked to declare or send raises `TransportError`; so does a
key that is not a key expression.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol, Self, TypeAlias

if TYPE_CHECKING:
    from types import TracebackType

    from reconros_zenoh.ros.qos import QosProfile

Buffer: TypeAlias = bytes | bytearray | memoryview
"""Bytes; a `memoryview` has one dimension and format `B` (`memoryview(array).cast("B")`)."""

Parts: TypeAlias = Sequence[Buffer]
"""A payload in pieces, joined with as few copies as possible. Nobody may change them after the call: a
single one may reach its reader by reference."""

OnMatching: TypeAlias = Callable[[bool], None]
"""Gets whether there is a counterpart: the present state at once, then each change."""

_NAME = re.compile(r"[A-Za-z0-9_.-]+")


def is_name(text: str) -> bool:
    """Tell whether a name can be one part of a key of ours: letters, digits, `-`, `_` and `.`."""
    return _NAME.fullmatch(text) is not None


class Sample(NamedTuple):
    """A message that a subscription received: the key it was published on, and what was put.

    The payload has format `B`, is read-only and does not change any more.
    """

    key: str
    attachment: bytes | None
    payload: memoryview


class Request(Protocol):
    """A request that a server received; reply once, from any thread, maybe much later."""

    @property
    def key(self) -> str:
        """The key it was sent to."""

    @property
    def attachment(self) -> bytes | None:
        """The attachment it was sent with."""

    def read(self) -> memoryview:
        """Copy the payload out of the transport, as a `Sample` has it; once, before the reply."""

    def reply(self, parts: Parts, attachment: bytes | None) -> None:
        """Answer it; without effect when the client no longer waits."""

    def reply_error(self, text: str) -> None:
        """Answer it with an error; without effect when the client no longer waits."""


class Reply(NamedTuple):
    """An answer of one server: a payload (format `B`, read-only) or an error, never both."""

    payload: memoryview | None
    attachment: bytes | None
    error: str | None


OnReply: TypeAlias = Callable[[Reply | None], None]
"""Gets each reply to one request, and then None once when the request is over."""


class Declaration(Protocol):
    """Something that stands in the network until it is closed."""

    def close(self) -> None:
        """Take it out of the network; once this returns its callbacks are not called any more. Idempotent."""


class Publisher(Declaration, Protocol):
    """Sends messages on one key."""

    def put(self, parts: Parts, attachment: bytes | None) -> None:
        """Send one message.

        Waits only where the congestion control does: BLOCK for RELIABLE with KEEP_ALL, else DROP.
        """


class Querier(Declaration, Protocol):
    """Sends requests to every server of one key."""

    def get(self, parts: Parts, attachment: bytes | None, on_reply: OnReply, timeout_ns: int) -> None:
        """Send one request.

        It is over when every server has answered or let go of it, at the latest after `timeout_ns`. A timeout
        gives no `Reply`. After `close()` a request that still waits is not heard of any more.
        """


class Transport(Protocol):
    """A session in the network; as a context manager it closes itself."""

    @property
    def session_id(self) -> str:
        """The id of the session as it stands in graph tokens: lower case hexadecimal."""

    def publish(self, key: str, qos: QosProfile, on_matching: OnMatching | None = None) -> Publisher:
        """Declare a publisher on a key without wildcards.

        With TRANSIENT_LOCAL its last `qos.depth` messages reach late subscribers, too.
        """

    def subscribe(
        self, key: str, sink: Callable[[Sample], None], qos: QosProfile, usual_key: str | None = None
    ) -> Declaration:
        """Hand every message whose key matches the key expression `key` to `sink`, in order per publisher.

        With TRANSIENT_LOCAL the last `qos.depth` messages of each transient local publisher come first. With
        wildcards in `key`, messages on `usual_key` still cost no more than without.
        """

    def serve(self, key: str, sink: Callable[[Request], None], *, complete: bool = True) -> Declaration:
        """Hand every request on `key` to `sink` (a queryable).

        One that is not complete is for requests that no complete one takes. A `Querier` sends it none.
        """

    def request(self, key: str, on_matching: OnMatching | None = None) -> Querier:
        """Declare a querier on a key without wildcards: target ALL_COMPLETE, no consolidation.

        A request before the session has heard of a server (`on_matching`) is over at once.
        """

    def declare_token(self, key: str) -> Declaration:
        """Declare a liveliness token: it is alive until it is closed or the session ends."""

    def tokens(self, key: str, timeout_ns: int) -> list[str]:
        """Return the keys of the live tokens that match `key`; blocks for at most `timeout_ns`."""

    def watch_tokens(self, key: str, on_change: Callable[[str, bool], None]) -> Declaration:
        """Report each matching token with True when it comes alive and with False when it goes.

        Tokens that are alive already are reported first.
        """

    def close(self) -> None:
        """Close every declaration and leave the network. Idempotent; not to be called by a sink."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
