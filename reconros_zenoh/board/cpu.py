"""The processor cores of a board."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.board.sharing import SharedResource

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class Cpu:
    """Cores on which the communication stack comes first and all other threads share what is left.

    A thread runs on one core at a time. The stack has fixed priority because its work is done by the kernel's
    network code and by the threads of the DDS, which never wait long for a callback to end.
    """

    def __init__(self, environment: VirtualEnvironment, cores: int) -> None:
        self.cores = SharedResource(environment, capacity=cores, per_job=1)

    def run(self, core_time_ns: float) -> Generator[Awaitable, object, None]:
        """Return when a thread has had `core_time_ns` on the cores."""
        return self.cores.serve(core_time_ns)

    def run_stack(self, core_time_ns: float, share: float) -> Generator[Awaitable, object, None]:
        """Return when the stack has had `core_time_ns`, of one core at most `share` at a time."""
        return self.cores.serve(core_time_ns, share, first=True)

    @property
    def is_busy(self) -> bool:
        """Whether other threads keep every core busy, or the stack is stalled."""
        return self.cores.is_saturated

    def stall_stack(self) -> None:
        """Keep the communication stack from running until `resume_stack`."""
        self.cores.hold_first()

    def resume_stack(self) -> None:
        """Take back one `stall_stack`."""
        self.cores.release_first()
