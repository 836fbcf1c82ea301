"""The slots of a board."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.board.busy_time import BusyTime
from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from reconros_zenoh.board.trace import Trace
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class Slot:
    """A region of the FPGA that holds one hardware thread or gateway at a time (RS #x); empty at power-up.

    `tenants` are the names of all that may be in it; one that must never be swapped out is there alone. A
    slot that is not `reconfigurable` has one tenant and holds it from power-up on. It is `busy` from when its
    bitstream is there until the call ends, waits of the callback included; `reconfiguring` while the ICAP
    writes to it, and `waiting` until the ICAP does.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        slot_id: int,
        bitstream_size: int,
        clock_hz: float,
        *,
        reconfigurable: bool,
        trace: Trace | None = None,
    ) -> None:
        self.slot_id = slot_id
        self.bitstream_size = bitstream_size
        self.clock_hz = clock_hz
        self.reconfigurable = reconfigurable
        self.holds: Bitstream | None = None
        self.tenants: set[str] = set()
        self.is_given_away = False
        self.reconfigurations = 0
        self.track = trace.add_slot(slot_id) if trace else None
        self.busy = BusyTime(environment)
        self.reconfiguring = BusyTime(environment, trace.icap if trace else None)
        self.waiting = BusyTime(environment)

    def check(self, name: str, *, alone: bool = False) -> None:
        """Raise UsageError unless this hardware thread or gateway can be in the slot.

        It cannot when it, or who is there, must be `alone`, or the slot has its one tenant.
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

    def admit(self, name: str, *, alone: bool = False) -> Bitstream:
        """Let this hardware thread or gateway be in the slot, and return the bitstream that brings it there.

        Raise UsageError as `check`.
        """
        self.check(name, alone=alone)
        self.tenants.add(name)
        self.is_given_away = alone
        bitstream = Bitstream(self.slot_id, name, self.bitstream_size)
        if not self.reconfigurable:
            self.holds = bitstream
        return bitstream
