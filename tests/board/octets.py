"""Messages of bytes, whose size on the wire a test chooses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from small_board import types

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

OCTETS = types().message("std_msgs/msg/UInt8MultiArray")
HEADER = 4 + 4 + 4 + 4  # encapsulation, dimensions, offset, count
_LAYOUT = types().message("std_msgs/msg/MultiArrayLayout").cls(dim=[], data_offset=0)


def octets(data: ArrayLike) -> Any:
    """The message that brings these bytes; an array of them is not copied."""
    return OCTETS.cls(layout=_LAYOUT, data=np.asarray(data, np.uint8))


def sized(size: int, first: int = 0) -> Any:
    """A message of `size` bytes on the wire: `first`, then zeros; it cannot change any more."""
    data = np.zeros(size - HEADER, np.uint8)
    data[0] = first
    data.flags.writeable = False
    return octets(data)


def size_of(message: Any) -> int:
    """How many bytes the message has on the wire."""
    return sum(map(len, OCTETS.encode(message)))
