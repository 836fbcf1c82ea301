"""What a board says in the log."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import MutableMapping

    from reconros_zenoh.clock.virtual import VirtualEnvironment


class BoardLog(logging.LoggerAdapter[logging.Logger]):
    """The logger `reconros_zenoh.<board>`, or that of a callback below it; may be used from any thread.

    Its records have `elapsed_ms`, the time on the board's clock since `started_ns`, as status and traces have
    it: in virtual time that of the host would say nothing.
    """

    def __init__(self, environment: VirtualEnvironment, started_ns: int, name: str) -> None:
        super().__init__(logging.getLogger(f"reconros_zenoh.{name}"))
        self._environment = environment
        self._started_ns = started_ns
        self._name = name

    def of(self, callback: str) -> BoardLog:
        """Return the logger of a callback."""
        return BoardLog(self._environment, self._started_ns, f"{self._name}.{callback}")

    def process(
        self, msg: object, kwargs: MutableMapping[str, Any]
    ) -> tuple[object, MutableMapping[str, Any]]:
        """Add the time to a record."""
        elapsed_ms = (self._environment.clock_ns() - self._started_ns) / 1e6
        kwargs["extra"] = {**(kwargs.get("extra") or {}), "elapsed_ms": elapsed_ms}
        return msg, kwargs
