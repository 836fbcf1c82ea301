"""/scope: measures the control loop of the design example from outside."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from reconros_zenoh.applications.roundtrip.kernels.inverse import LEGS, inverse_kinematics
from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.measure.record import RoundTrip

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.types import TypeRegistry


class Scope:
    """Listens to /ctrl_out and /tf_out and tells how long the inverse kinematics took between them.

    `on_trip`, in the thread of the event loop, gets a round trip per command of the controller: its number,
    the time until its servo index was published, and `ok`. A command is `lost` when the index of a later one
    comes first, and `wrong` stands for an index that no open command asks for.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        context: Context,
        types: TypeRegistry,
        on_trip: Callable[[RoundTrip], None],
    ) -> None:
        self._environment = environment
        self._on_trip = on_trip
        self._commands = 0
        self._matched = False
        self._open: deque[tuple[int, int, int]] = deque()
        self._node = context.node("scope")
        word = types.message("std_msgs/msg/UInt32")
        self._node.subscription(word, "/ctrl_out", self._on_ctrl_out, check=_check)
        self._node.subscription(word, "/tf_out", self._on_tf_out)

    def close(self) -> None:
        """Take the node out of the graph."""
        self._node.close()

    def _on_ctrl_out(self, received: Received) -> None:
        self._environment.post(self._command, received.message.data, self._environment.clock_ns())

    def _on_tf_out(self, received: Received) -> None:
        self._environment.post(self._index, received.message.data, self._environment.clock_ns())

    def _command(self, word: int, arrived_ns: int) -> None:
        self._open.append((self._commands, inverse_kinematics(word), arrived_ns))
        self._commands += 1

    def _index(self, word: int, arrived_ns: int) -> None:
        if all(expected != word for _, expected, _ in self._open):
            if self._matched:  # before, its command may have been published when nobody listened here
                self._on_trip(RoundTrip(self._commands - 1, 0, "wrong"))
            return
        while True:
            number, expected, asked_ns = self._open.popleft()
            if expected == word:
                self._matched = True
                self._on_trip(RoundTrip(number, arrived_ns - asked_ns, "ok"))
                return
            self._on_trip(RoundTrip(number, None, "lost"))


def _check(message: Any) -> None:
    leg = message.data & 0x7
    if leg >= LEGS:
        raise BadMessageError("leg", f"leg {leg} was asked for, the platform has 0 to {LEGS - 1}")
