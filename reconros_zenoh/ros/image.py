"""Pictures as sensor_msgs/Image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from reconros_zenoh.ros.type_registry import TypeRegistry


def image_fields(encoding: str, picture: NDArray[np.uint8]) -> dict[str, Any]:
    """Return all but the header: of a picture, uint8[height, width] or uint8[height, width, channels]."""
    return {
        "height": picture.shape[0],
        "width": picture.shape[1],
        "encoding": encoding,
        "is_bigendian": 0,
        "step": picture[0].size,
        "data": picture.reshape(-1),
    }


def image_message(types: TypeRegistry, encoding: str, picture: NDArray[np.uint8]) -> Any:
    """Return the message of a picture like those of `image_fields`, with a header of zeros."""
    header = zero_message(types.message("std_msgs/msg/Header"))
    return types.message("sensor_msgs/msg/Image").cls(header=header, **image_fields(encoding, picture))
