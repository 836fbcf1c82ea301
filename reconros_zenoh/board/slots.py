"""The reconfigurable slots of a board."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reconros_zenoh.board.bitstream import Bitstream


@dataclass(slots=True)
class ReconfigurableSlot:
    """A region of the FPGA that holds one hardware thread at a time (RS #x); empty at power-up."""

    slot_id: int
    bitstream_size: int
    clock_hz: float
    holds: Bitstream | None = field(default=None, init=False)
    reconfigurations: int = field(default=0, init=False)
    reconfiguration_ns: int = field(default=0, init=False)
    busy_ns: int = field(default=0, init=False)
