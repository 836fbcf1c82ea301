"""The slots of a board."""

from __future__ import annotations

from dataclasses import dataclass, field

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.errors import UsageError


@dataclass(slots=True)
class ReconfigurableSlot:
    """A region of the FPGA that holds one hardware thread at a time (RS #x); empty at power-up.

    One that is not `reconfigurable` holds the same from power-up on.
    """

    slot_id: int
    bitstream_size: int
    clock_hz: float
    reconfigurable: bool = True
    holds: Bitstream | None = field(default=None, init=False)
    reconfigurations: int = field(default=0, init=False)
    reconfiguration_ns: int = field(default=0, init=False)
    busy_ns: int = field(default=0, init=False)

    def hold(self, name: str) -> Bitstream:
        """Return what the slot holds since power-up: the hardware thread of this name.

        Raise UsageError when it is another.
        """
        if self.holds is not None and self.holds.callback != name:
            raise UsageError(
                f"{name!r} is mapped to slot {self.slot_id}, which is not reconfigurable and holds "
                f"{self.holds.callback!r}. Map one of them elsewhere, or make the slot reconfigurable."
            )
        self.holds = Bitstream(self.slot_id, name, self.bitstream_size)
        return self.holds
