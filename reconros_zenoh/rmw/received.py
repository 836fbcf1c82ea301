"""A message or request as a node gets it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from reconros_zenoh.transport.base import Parts


class Responder(Protocol):
    """The way back to the client of a request; callable from any thread, once."""

    def respond_encoded(self, parts: Parts) -> None:
        """Send the encoded response."""

    def fail(self, text: str) -> None:
        """Tell the client that there will be no response, and why."""


class Received(NamedTuple):
    """A decoded message, the bytes it had on the wire, and how long it was on its way.

    `transit_ns` is the present time of the context's clock minus the source timestamp: between hosts it is
    only as good as their clocks agree. `responder` is None but for a request, `publisher` is the gid of the
    publisher of a message or the client of a request, `sequence_number` that of the call which a response
    answers.
    """

    message: Any
    size: int
    transit_ns: int
    responder: Responder | None = None
    publisher: bytes = b""
    sequence_number: int | None = None
