"""Sort client: calls the sorter service."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from host_clients.exchange import Exchange
from reconros_zenoh.applications.roundtrip.inputs import numbers
from reconros_zenoh.errors import BadMessageError, TransportError
from reconros_zenoh.rmw.received import Received

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator

    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.type_registry import TypeRegistry

_TYPE = "sorter_msgs/srv/Sort"


class SortExchange(Exchange):
    """2048 numbers out, the same numbers in order back."""

    name = "sort"

    def __init__(self, rng: Generator) -> None:
        self._inputs = numbers(rng, 16)
        self._sorted = np.sort(self._inputs, axis=1)

    def open(
        self,
        node: Node,
        types: TypeRegistry,
        on_answer: Callable[[Any], None],
        on_matching: Callable[[bool], None],
    ) -> None:
        """Announce the client."""
        folder = resources.files("reconros_zenoh.applications.roundtrip") / "msg"
        types.add_service(_TYPE, (folder / "sorter_msgs" / "srv" / "Sort.srv").read_text(encoding="utf-8"))
        service_type = types.service(_TYPE)
        encode, message = service_type.request.encode, service_type.request.cls
        self._requests = [b"".join(encode(message(unsorted=row))) for row in self._inputs]
        self._on_answer = on_answer
        self._client = node.client(service_type, "/sorter", on_matching)

    def prepare(self, requests: int) -> None:
        """Do nothing: the few requests and answers are there."""

    def ask(self, index: int, limit_ns: int) -> None:
        """Call the service."""
        self._client.call_encoded((self._requests[index % len(self._requests)],), self._take, limit_ns)

    def is_right(self, index: int, answer: Any) -> bool:
        """Compare all numbers."""
        return not isinstance(answer, BadMessageError) and np.array_equal(
            answer.sorted, self._sorted[index % len(self._sorted)]
        )

    def _take(self, answer: Received | BadMessageError | TransportError) -> None:
        # Without an answer the request is lost, which the loop notes at its limit: a server that has gone is
        # not asked again at once, and not from within the callback in which Zenoh says so.
        if not isinstance(answer, TransportError):
            self._on_answer(answer.message if isinstance(answer, Received) else answer)
