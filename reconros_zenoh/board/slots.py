"""The slots of a board."""

from __future__ import annotations

from dataclasses import dataclass, field

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.errors import UsageError


@dataclass(slots=True)
class Slot:
    """A region of the FPGA that holds one hardware thread or gateway at a time (RS #x); empty at power-up.

    `tenants` are the names of all that may be in it; one that must never be swapped out is there alone. A
    slot that is not `reconfigurable` has one tenant and holds it from power-up on.
    """

    slot_id: int
    bitstream_size: int
    clock_hz: float
    reconfigurable: bool
    holds: Bitstream | None = field(default=None, init=False)
    tenants: set[str] = field(default_factory=set, init=False)
    is_given_away: bool = field(default=False, init=False)
    reconfigurations: int = field(default=0, init=False)
    reconfiguration_ns: int = field(default=0, init=False)
    busy_ns: int = field(default=0, init=False)

    def admit(self, name: str, *, alone: bool = False) -> Bitstream:
        """Let this hardware thread or gateway be in the slot, and return the bitstream that brings it there.

        Raise UsageError when it, or who is there, must be `alone`, or the slot has its one tenant.
        """
        if alone or self.is_given_away:
            in_the_way = self.tenants
        else:
            in_the_way = set() if self.reconfigurable else self.tenants - {name}
        if in_the_way:
            kind = "" if self.reconfigurable else " and is not reconfigurable"
            raise UsageError(
                f"{name!r} cannot be in slot {self.slot_id}, which is for {', '.join(sorted(in_the_way))}"
                f"{kind}. Give one of them another slot."
            )
        self.tenants.add(name)
        self.is_given_away = alone
        bitstream = Bitstream(self.slot_id, name, self.bitstream_size)
        if not self.reconfigurable:
            self.holds = bitstream
        return bitstream
