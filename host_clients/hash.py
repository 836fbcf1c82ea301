"""Hash client: listens to the hashes that the board publishes on its timer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from host_clients.exchange import Exchange
from reconros_zenoh.applications.roundtrip.kernels.hash import sha256, source

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.random import Generator

    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.type_registry import TypeRegistry


class HashExchange(Exchange):
    """Nothing out; every 250 ms a digest back. What is measured is the time between two of them."""

    name = "hash"
    asks = False

    def __init__(self, _: Generator) -> None:
        self._digest = sha256(source())

    def open(
        self,
        node: Node,
        types: TypeRegistry,
        on_answer: Callable[[Any], None],
        on_matching: Callable[[bool], None],
    ) -> None:
        """Subscribe; there is nobody to wait for but the first message."""
        node.subscription(
            types.message("std_msgs/msg/UInt32MultiArray"),
            "/hash",
            lambda received: on_answer(received.message),
        )
        on_matching(True)

    def prepare(self, requests: int) -> None:
        """Do nothing: there are no requests."""

    def ask(self, index: int, limit_ns: int) -> None:
        """Do nothing: the board's timer asks."""

    def is_right(self, index: int, answer: Any) -> bool:  # noqa: ARG002 - every answer is the same
        """Compare the digest."""
        return np.array_equal(answer.data, self._digest)
