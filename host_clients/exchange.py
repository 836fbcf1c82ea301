"""What a client asks a board, and when an answer is right."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.type_registry import TypeRegistry


class Exchange(ABC):
    """Requests in a cycle, and the right answer to each.

    `asks` is False for a client that only listens. An answer is the message that came, or the error that came
    instead; `on_answer` is called on a thread of the transport.
    """

    name: str
    asks = True

    @abstractmethod
    def open(
        self,
        node: Node,
        types: TypeRegistry,
        on_answer: Callable[[Any], None],
        on_matching: Callable[[bool], None],
    ) -> None:
        """Declare the endpoints; `on_matching` is told whether somebody serves the requests."""

    @abstractmethod
    def prepare(self, requests: int) -> None:
        """Make the first `requests` requests and their answers, so that no round trip waits for that."""

    @abstractmethod
    def ask(self, index: int, limit_ns: int) -> None:
        """Send request number `index`; nobody waits longer than `limit_ns` for its answer."""

    @abstractmethod
    def is_right(self, index: int, answer: Any) -> bool:
        """Tell whether `answer` is the right one to request number `index`."""


class TopicExchange(Exchange):
    """Publishes requests on one topic and listens for the answers on another: base of three clients.

    Each request is encoded once.
    """

    request_topic: str
    request_type: str
    answer_topic: str
    answer_type: str

    def __init__(self, inputs: list[Any]) -> None:
        self._inputs = inputs
        self._expected = cache(self.expected)
        self._encoded: dict[int, bytes] = {}

    @abstractmethod
    def request(self, types: TypeRegistry, given: Any) -> object:
        """Return the request message for one input."""

    @abstractmethod
    def expected(self, index: int) -> Any:
        """Return the right answer to input number `index`."""

    @abstractmethod
    def equal(self, message: Any, expected: Any) -> bool:
        """Tell whether a message carries the expected answer."""

    def open(
        self,
        node: Node,
        types: TypeRegistry,
        on_answer: Callable[[Any], None],
        on_matching: Callable[[bool], None],
    ) -> None:
        """Subscribe to the answers, then announce the requests."""
        self._types = types
        node.subscription(
            types.message(self.answer_type), self.answer_topic, lambda received: on_answer(received.message)
        )
        self._publisher = node.publisher(
            types.message(self.request_type), self.request_topic, on_matching=on_matching
        )

    def prepare(self, requests: int) -> None:
        """Encode the requests and compute the answers."""
        for place in range(min(requests, len(self._inputs))):
            self._encode(place)
            self._expected(place)

    def ask(self, index: int, limit_ns: int) -> None:  # noqa: ARG002 - what was published cannot be given up
        """Publish request number `index`, counting round and round."""
        self._publisher.publish_encoded((self._encode(index % len(self._inputs)),))

    def _encode(self, place: int) -> bytes:
        encoded = self._encoded.get(place)
        if encoded is None:
            message = self.request(self._types, self._inputs[place])
            encoded = self._encoded[place] = b"".join(self._publisher.message_type.encode(message))
        return encoded

    def is_right(self, index: int, answer: Any) -> bool:
        """Tell whether `answer` is the right one to request number `index`."""
        return self.equal(answer, self._expected(index % len(self._inputs)))
