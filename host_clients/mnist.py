"""MNIST client: sends digits to be classified."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from host_clients.exchange import TopicExchange
from reconros_zenoh.applications.roundtrip.inputs import digits
from reconros_zenoh.applications.roundtrip.kernels.mnist import shipped_classifier
from reconros_zenoh.ros.image import image_message

if TYPE_CHECKING:
    from numpy.random import Generator

    from reconros_zenoh.ros.type_registry import TypeRegistry


class MnistExchange(TopicExchange):
    """An image of a digit out, its class back.

    The right answer is what the shipped network says, not the label: the network errs in one of two
    hundred.
    """

    name = "mnist"
    request_topic = "/image_classification"
    request_type = "sensor_msgs/msg/Image"
    answer_topic = "/class"
    answer_type = "std_msgs/msg/UInt32"

    def __init__(self, rng: Generator) -> None:
        images, _ = digits()
        super().__init__(list(rng.permutation(images)))
        self._classifier = shipped_classifier()

    def request(self, types: TypeRegistry, given: Any) -> object:
        """Return the digit as a message."""
        return image_message(types, "mono8", given)

    def expected(self, index: int) -> int:
        """Return what the network says."""
        return self._classifier.classify(self._inputs[index])

    def equal(self, message: Any, expected: int) -> bool:
        """Compare the digits."""
        return bool(message.data == expected)
