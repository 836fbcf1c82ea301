"""/scope: measures the control loop of the design example from outside."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from reconros_zenoh.applications.roundtrip.callbacks.checks import check_leg
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics
from reconros_zenoh.measure.record import RoundTrip

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.type_registry import TypeRegistry


_LATE_NS = 1_000_000_000
_MOST_WAITING = 1000  # commands without an index, or the reverse; then one side is gone or hostile


class Scope:
    """Listens to /ctrl_out and /tf_out and tells how long the inverse kinematics took between them.

    `on_trip`, called by the event loop, gets a round trip per command of the controller: its number,
    the time from its publication to that of its servo index (source timestamps), and `ok`. A command is
    `lost` when the index of a later one comes first, and `wrong` stands for an index that no command asks for
    within a second. The topics come over two threads, so an index may be heard before its command.
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
        self._open: deque[_Command] = deque()
        self._early: deque[tuple[int, int]] = deque(maxlen=_MOST_WAITING)
        self._node = context.node("scope")
        word = types.message("std_msgs/msg/UInt32")
        self._node.subscription(word, "/ctrl_out", self._on_ctrl_out, check=check_leg)
        self._node.subscription(word, "/tf_out", self._on_tf_out)

    def _on_ctrl_out(self, received: Received) -> None:
        self._environment.post(self._command, received.message.data, self._sent_ns(received))

    def _on_tf_out(self, received: Received) -> None:
        self._environment.post(self._index, received.message.data, self._sent_ns(received))

    def _sent_ns(self, received: Received) -> int:
        return self._node.context.clock_ns() - received.transit_ns

    def _command(self, word: int, sent_ns: int) -> None:
        self._open.append(_Command(self._commands, inverse_kinematics(word), sent_ns))
        self._commands += 1
        if len(self._open) > _MOST_WAITING:
            self._on_trip(RoundTrip(self._open.popleft().number, None, "lost"))
        for index in list(self._early):
            if self._match(*index):
                self._early.remove(index)

    def _index(self, word: int, sent_ns: int) -> None:
        while self._early and self._early[0][1] < sent_ns - _LATE_NS:
            self._early.popleft()
            if self._matched:  # before, its command may have been published when nobody listened here
                self._on_trip(RoundTrip(self._commands, 0, "wrong"))
        if not self._match(word, sent_ns):
            self._early.append((word, sent_ns))

    def _match(self, word: int, sent_ns: int) -> bool:
        """Tell whether an open command asks for this index; it and those before it are open no more."""
        if not any(command.asks_for(word, sent_ns) for command in self._open):
            return False
        while not (command := self._open.popleft()).asks_for(word, sent_ns):
            self._on_trip(RoundTrip(command.number, None, "lost"))
        self._matched = True
        self._on_trip(RoundTrip(command.number, sent_ns - command.sent_ns, "ok"))
        return True


class _Command(NamedTuple):
    number: int
    expected: int
    sent_ns: int

    def asks_for(self, word: int, sent_ns: int) -> bool:
        return self.expected == word and self.sent_ns <= sent_ns
