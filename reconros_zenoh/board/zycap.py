"""Partial reconfiguration over the one ICAP (ReconROS Executor, Sections III-A and V-B)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import simpy

from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping

    from reconros_zenoh.board.bitstream import Bitstream
    from reconros_zenoh.board.cpu import Cpu
    from reconros_zenoh.board.profile import DdsSection, IcapSection
    from reconros_zenoh.board.slots import Slot
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class ZyCAP:
    """The three functions of the ReconROS library: `init`, `write_bitstream`, `deinit`.

    A write takes `t_rc = S / B + t_offset` and, where the profile says so, keeps the communication stack off
    the cores meanwhile and until it has recovered. There is one ICAP: writes queue for it. `icap` is None
    where nothing is modelled.
    """

    def __init__(
        self, environment: VirtualEnvironment, cpu: Cpu, icap: IcapSection | None, dds: DdsSection | None
    ) -> None:
        self._environment = environment
        self._cpu = cpu
        self._icap = icap
        self._recovery_ns = dds.recovery.ns if dds is not None and dds.stalled_by_reconfiguration else None
        self._port = simpy.Resource(environment, capacity=1)
        self._prefetched: Mapping[tuple[int, str], Bitstream] = {}

    def init(self, bitstreams: Mapping[tuple[int, str], Bitstream]) -> None:
        """Hold these bitstreams in memory, so that a write need not read a file."""
        self._prefetched = bitstreams

    def deinit(self) -> None:
        """Hold no bitstream any more."""
        self._prefetched = {}

    def bitstream(self, slot_id: int, callback: str) -> Bitstream:
        """Return the prefetched bitstream; raise UsageError when there is none."""
        try:
            return self._prefetched[slot_id, callback]
        except KeyError:
            raise UsageError(f"there is no bitstream of callback {callback!r} for slot {slot_id}.") from None

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
