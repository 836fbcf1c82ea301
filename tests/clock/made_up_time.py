"""Time that passes when a test says so, in place of the monotonic clock."""

from __future__ import annotations

US = 1_000
MS = 1_000_000
YIELD = 30 * US
"""How long it takes to offer the interpreter to others when none wants it."""


class MadeUpTime:
    """Stands in for the module `time`; who is offered the interpreter next keeps it for `next_yield_ns`."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.yields = 0
        self.next_yield_ns = YIELD

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        assert seconds == 0
        self.yields += 1
        self.now_ns += self.next_yield_ns
        self.next_yield_ns = YIELD
