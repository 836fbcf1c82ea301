"""What all transports have in common: they can be closed, and they guard the callbacks they call."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from threading import RLock
from typing import TYPE_CHECKING, Self, TypeVarTuple, Unpack

from reconros_zenoh.errors import TransportError

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

_log = logging.getLogger(__name__)
_Arguments = TypeVarTuple("_Arguments")


class Closing(ABC):
    """As a context manager it closes itself."""

    __slots__ = ()

    @abstractmethod
    def close(self) -> None:
        """Be over. Idempotent."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class GuardedDeclaration(ABC):
    """A declaration whose callbacks run one at a time and never once `close` has returned.

    A subclass calls them through `call` and says in `withdraw` how it leaves the network.
    """

    __slots__ = ("_has_failed", "is_closed", "key", "lock")

    def __init__(self, key: str) -> None:
        self.key = key
        self._has_failed = False
        self.is_closed = False
        self.lock = RLock()  # a callback may close its own declaration

    def call(self, callback: Callable[[Unpack[_Arguments]], None], *arguments: *_Arguments) -> None:
        """Run `callback` unless this is closed; its first exception is logged, none leaves this method."""
        with self.lock:
            if not self.is_closed:
                try:
                    callback(*arguments)
                except Exception:  # noqa: BLE001 # whatever a callback raises, the transport goes on
                    self.log_failure()

    def log_failure(self) -> None:
        """Log the exception being handled, if it is the first."""
        if not self._has_failed:
            self._has_failed = True
            _log.exception("a callback for %s failed; it is not reported again", self.key)

    def check_open(self) -> None:
        """Raise TransportError when this is closed."""
        if self.is_closed:
            raise TransportError(f"{self.key} is closed: nothing can be sent on it any more")

    def close(self) -> None:
        """Leave the network; waits for a callback that runs on another thread. Idempotent."""
        with self.lock:
            if self.is_closed:
                return
            self.is_closed = True
        self.withdraw()

    @abstractmethod
    def withdraw(self) -> None:
        """Leave the network; called once."""
