"""Inverse client: asks for servo angles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from host_clients.exchange import TopicExchange
from reconros_zenoh.applications.roundtrip.inputs import angles
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics

if TYPE_CHECKING:
    from numpy.random import Generator

    from reconros_zenoh.ros.type_registry import TypeRegistry


class InverseExchange(TopicExchange):
    """A packed orientation out, a servo index back."""

    name = "inverse"
    request_topic = "/angle"
    request_type = "std_msgs/msg/UInt32"
    answer_topic = "/legangle"
    answer_type = "std_msgs/msg/UInt32"

    def __init__(self, rng: Generator) -> None:
        super().__init__(angles(rng, 64).tolist())

    def request(self, types: TypeRegistry, given: int) -> object:
        """Return the orientation as a message."""
        return types.message(self.request_type).cls(data=given)

    def expected(self, index: int) -> int:
        """Return what the kernel computes."""
        return inverse_kinematics(self._inputs[index])

    def equal(self, message: Any, expected: int) -> bool:
        """Compare the words."""
        return bool(message.data == expected)
