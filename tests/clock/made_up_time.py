"""Time that passes when a test says so, in place of the monotonic clock."""

from __future__ import annotations

US = 1_000
MS = 1_000_000


class MadeUpTime:
    """Stands in for the module `time`."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.spins = 0

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        assert seconds == 0
        self.spins += 1
        self.now_ns += 30 * US
