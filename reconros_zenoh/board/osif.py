"""The operating system interface of a slot and its delegate thread."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.cpu import Cpu
    from reconros_zenoh.clock.activity import Awaitable


class Osif:
    """Calls of a hardware thread that its delegate, a thread on the cores, carries out for it.

    Source: Gateways, Section 2.2. A call costs `call_ns` of core time.
    """

    def __init__(self, cpu: Cpu, call_ns: int) -> None:
        self._cpu = cpu
        self._call_ns = call_ns

    def call(self) -> Generator[Awaitable, object, None]:
        """Return when the delegate has carried out one call."""
        return self._cpu.run(self._call_ns)
