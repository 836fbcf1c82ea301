"""What messages must be for several callbacks and clients, here and in the design example, to take them."""

from __future__ import annotations

from typing import Any

from reconros_zenoh.applications.roundtrip.kernels.inverse import LEGS
from reconros_zenoh.errors import BadMessageError


def check_image(message: Any, encoding: str, height: int, width: int, channels: int) -> None:
    """Raise BadMessageError unless the image has this encoding and size, without padding between its rows."""
    if message.encoding != encoding:
        raise BadMessageError("image_encoding", f"the image is {message.encoding!r}, not {encoding!r}")
    size = (message.height, message.width, message.step, len(message.data))
    if size != (height, width, width * channels, height * width * channels):
        raise BadMessageError(
            "image_size",
            f"the image has height {size[0]}, width {size[1]}, step {size[2]} and {size[3]} bytes, not "
            f"{height}, {width}, {width * channels} and {height * width * channels}",
        )


def check_leg(message: Any) -> None:
    """Raise BadMessageError for a packed orientation with a leg that the platform does not have."""
    leg = message.data & 0x7
    if leg >= LEGS:
        raise BadMessageError("leg", f"leg {leg} was asked for, the platform has 0 to {LEGS - 1}")
