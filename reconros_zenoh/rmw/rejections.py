"""Bad messages: counted by reason, logged once per sender."""

from __future__ import annotations

import logging
import threading
from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.errors import BadMessageError

_log = logging.getLogger(__name__)
_SENDERS_KEPT = 10_000


class Rejections:
    """What was refused since the start; callable from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()
        self._logged: set[tuple[str, str]] = set()

    def add(self, key: str, sender: str | None, error: BadMessageError) -> None:
        """Count a refused message; log it when it is the first of its kind from this sender.

        `sender` is the sender's gid in hexadecimal, or the name of the callback that published inside a slot;
        None when the message does not tell.
        """
        with self._lock:
            self._counts[error.reason] += 1
            first = (error.reason, sender or key)
            if first in self._logged or len(self._logged) >= _SENDERS_KEPT:
                return
            self._logged.add(first)
        _log.warning(
            "refused a message on %s from %s (%s); more of its kind are counted only",
            key,
            f"publisher {sender}" if sender else "an unknown sender",
            error,
        )

    def counts(self) -> Mapping[str, int]:
        """Return how many messages were refused, by reason."""
        with self._lock:
            return dict(self._counts)
