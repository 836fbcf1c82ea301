"""Sobel client: sends pictures to be filtered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from xxhash import xxh3_128_digest

from host_clients.exchange import TopicExchange
from reconros_zenoh.applications.roundtrip.inputs import images
from reconros_zenoh.applications.roundtrip.kernels.sobel import sobel
from reconros_zenoh.ros.image import image_message

if TYPE_CHECKING:
    from numpy.random import Generator

    from reconros_zenoh.ros.type_registry import TypeRegistry


class SobelExchange(TopicExchange):
    """A picture out, its edges back."""

    name = "sobel"
    request_topic = "/image_raw"
    request_type = "sensor_msgs/msg/Image"
    answer_topic = "/filtered"
    answer_type = "sensor_msgs/msg/Image"

    def __init__(self, rng: Generator) -> None:
        super().__init__(list(images(rng, 8)))

    def request(self, types: TypeRegistry, given: Any) -> object:
        """Return the picture as a message."""
        return image_message(types, "bgr8", given)

    def expected(self, index: int) -> bytes:
        """Return the digest of what the kernel computes."""
        return xxh3_128_digest(sobel(self._inputs[index]).data)

    def equal(self, message: Any, expected: bytes) -> bool:
        """Compare all pixels, by their digest: it reads one picture where a comparison reads two."""
        return bool(message.encoding == "bgr8" and xxh3_128_digest(message.data.data) == expected)
