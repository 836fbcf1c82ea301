"""Service clients of a board: called by one callback, answered to another."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from reconros_zenoh.board.sources import Event, Reader
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import Writer
from reconros_zenoh.errors import BadMessageError, TransportError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.rmw.received import Received
from reconros_zenoh.ros.qos import History, QosProfile

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.types import ServiceType
    from reconros_zenoh.transport.base import Parts

_ANSWER_NS = 10_000_000_000
_UNSENT = "newer calls pushed it out before it was sent, or it cannot be sent"


class ClientSource(Reader):
    """A service client: callbacks call with it, and it is ready while a response waits.

    Every call ends in one event: its callback gets the response as its message, or None when the server
    refused or did not answer in time (10 s unless `send` is told otherwise), `check` refused the response,
    or the call was not sent, because of calls that wait to be sent the last 10 are kept. The first None
    since the last response is logged, `unanswered` counts them.
    Responses come in the order in which they arrive and wait however long it takes; each call has a
    `sequence_number`, which stands on the wire as in ROS 2.
    """

    kind = CallbackKind.CLT

    def __init__(
        self,
        board: Board,
        node: Node,
        service_type: ServiceType,
        name: str,
        on_matching: Callable[[bool], None] | None = None,
    ) -> None:
        """`on_matching` is as in `Transport.request`."""
        super().__init__(board, service_type.response, QosProfile(history=History.KEEP_ALL))
        self._client = node.client(service_type, name, on_matching)
        self._writer = Writer(board, QosProfile())
        self._is_answered = True
        self.unanswered = 0

    @property
    def dropped(self) -> int:
        """How many calls were pushed out by newer ones, or could not be sent."""
        return super().dropped + self._writer.dropped

    def request(self, **fields: object) -> Any:
        """Return a request of the service's type with these fields."""
        return self._client.service_type.request.message(**fields)

    def encode(self, request: object) -> Parts:
        """Return the request as it goes over the wire; callable from any thread."""
        return self._client.service_type.request.encode(request)

    def next_sequence_number(self) -> int:
        """Return the number of the next call; callable from any thread."""
        return self._client.next_sequence_number()

    def send(
        self, parts: Parts, sequence_number: int, timeline: Timeline, timeout_ns: int = _ANSWER_NS
    ) -> None:
        """Call the service with an encoded request."""
        on_response = partial(self._on_response, sequence_number)
        call = partial(
            self._client.call_encoded, parts, on_response, timeout_ns, sequence_number=sequence_number
        )
        unsent = partial(on_response, TransportError(_UNSENT))
        self._writer.put(parts, timeline, call, unsent)

    def _on_response(
        self, sequence_number: int, response: Received | BadMessageError | TransportError
    ) -> None:
        if isinstance(response, Received) and self._check is not None:
            try:
                self._check(response.message)
            except BadMessageError as error:
                self._client.context.rejections.add(self._client.key, None, error)
                response = error
        if isinstance(response, Received):
            self._is_answered = True
            self.arrive(response)
        else:
            self._board.environment.post(self._give_up, sequence_number, response)

    def _give_up(self, sequence_number: int, reason: BadMessageError | TransportError) -> None:
        self.unanswered += 1
        if self._is_answered:
            self._is_answered = False
            self._board.log.warning(
                "a call of service %s has no answer: %s; until one has, this is not reported again",
                self._client.name,
                reason,
            )
        timeline = Timeline(self._board.environment, self._board.environment.now)
        self.enqueue(Event(None, timeline, sequence_number=sequence_number))
