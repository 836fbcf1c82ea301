"""The memory interface of the slots."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.board.sharing import SharedResource

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class Memif:
    """One memory subsystem behind the MEMIFs of all slots: transfers that overlap share its bandwidth.

    Source: Gateways, Section 2.2 ("the available memory bandwidth is divided by the number of nodes that
    simultaneously access messages"). `bytes_per_ns` is None where nothing is modelled.
    """

    def __init__(self, environment: VirtualEnvironment, bytes_per_ns: float | None) -> None:
        self._modelled = bytes_per_ns is not None
        bandwidth = bytes_per_ns or 1
        self.bus = SharedResource(environment, capacity=bandwidth, per_job=bandwidth)

    def transfer(self, size: int) -> Generator[Awaitable, object, None]:
        """Return when `size` bytes have gone from or to the main memory."""
        return self.bus.serve(size if self._modelled else 0)
