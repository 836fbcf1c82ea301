"""When the health of a service is checked, and what the results mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from deploy.compose import Healthcheck


class Health:
    """The health of one service, by the rules of Docker's HEALTHCHECK; pure, times are given in ns.

    The first check starts one interval after the service, each further one an interval after the end of the
    last. `retries` failures in a row make the service unhealthy; failures of checks that began within the
    start period do not count.

    Deviation: a healthy service is not checked again, because the checks would take core time from the board
    that is being measured, and the runner sees a local process die anyway.
    """

    def __init__(self, rules: Healthcheck, started_ns: int) -> None:
        self._rules = rules
        self._counted_from_ns = started_ns + rules.start_period_ns
        self._failures = 0
        self.next_check_ns = started_ns + rules.interval_ns
        self.healthy = False

    @property
    def unhealthy(self) -> bool:
        """Whether the retries are used up."""
        return self._failures >= self._rules.retries

    def record(self, *, passed: bool, began_ns: int, ended_ns: int) -> None:
        """Take in the result of a check."""
        self.next_check_ns = ended_ns + self._rules.interval_ns
        if passed:
            self.healthy = True
        elif began_ns >= self._counted_from_ns:
            self._failures += 1
