"""Partial reconfiguration over the one ICAP (ReconROS Executor, Sections III-A and V-B)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import simpy

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.bitstream import Bitstream
    from reconros_zenoh.board.cpu import Cpu
    from reconros_zenoh.board.profile import DdsSection, IcapSection
    from reconros_zenoh.board.slots import Slot
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class ZyCAP:
    """Writes bitstreams into slots.

    A write takes `t_rc = S / B + t_offset` and, where the profile says so, keeps the communication stack off
    the cores meanwhile and until it has recovered. There is one ICAP: writes queue for it. `icap` is None
    where nothing is modelled. Deviation: no `init` and `deinit` as in the ReconROS library, because nothing
    of a bitstream but its name and size has to be held in memory.
    """

    def __init__(
        self, environment: VirtualEnvironment, cpu: Cpu, icap: IcapSection | None, dds: DdsSection | None
    ) -> None:
        self._environment = environment
        self._cpu = cpu
        self._icap = icap
        self._recovery_ns = dds.recovery.ns if dds is not None and dds.stalled_by_reconfiguration else None
        self._port = simpy.Resource(environment, capacity=1)

    def reconfiguration_ns(self, size: int) -> int:
        """Return how long a write of `size` bytes takes [ns], without waiting for the port."""
        if self._icap is None:
            return 0
        return round(size / self._icap.bandwidth.bytes_per_ns) + self._icap.offset.ns

    def write_bitstream(self, slot: Slot, bitstream: Bitstream) -> Generator[Awaitable, object, None]:
        """Return when the slot holds the bitstream; at once if and only if it does already."""
        if slot.holds == bitstream:
            return
        slot.waiting.begin()
        with self._port.request() as granted:
            yield granted
            slot.waiting.end()
            slot.reconfiguring.begin(bitstream.callback)
            slot.holds = None
            duration_ns = self.reconfiguration_ns(bitstream.size)
            if duration_ns:
                if self._recovery_ns is not None:
                    self._cpu.stall_stack()
                yield self._environment.timeout(duration_ns)
                if self._recovery_ns is not None:
                    self._environment.call_later(self._recovery_ns, self._cpu.resume_stack)
        slot.reconfiguring.end()
        slot.holds = bitstream
        slot.reconfigurations += 1
