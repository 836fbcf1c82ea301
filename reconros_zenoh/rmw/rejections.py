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
_SENDERS_NAMED = 100
"""Of each reason: whoever is hostile can be a new sender with each message."""


class Rejections:
    """What was refused since the start; callable from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()
        self._named: dict[str, set[bytes | str]] = {}

    def add(self, key: str, sender: bytes | str | None, error: BadMessageError) -> None:
        """Count a refused message; log it when it is the first of its kind from this sender.

        `sender` is the sender's gid, or the name of the callback that published inside a slot; None when the
        message does not tell.
        """
        with self._lock:
            self._counts[error.reason] += 1
            named = self._named.setdefault(error.reason, set())
            if (sender or key) in named or len(named) >= _SENDERS_NAMED:
                return
            named.add(sender or key)
            is_last = len(named) == _SENDERS_NAMED
        name = sender.hex() if isinstance(sender, bytes) else sender
        _log.warning(
            "refused a message on %s from %s (%s); more of its kind are counted only%s",
            key,
            f"publisher {name}" if name else "an unknown sender",
            error,
            ", whoever sends them: no more senders are named" if is_last else "",
        )

    def counts(self) -> Mapping[str, int]:
        """Return how many messages were refused, by reason."""
        with self._lock:
            return dict(self._counts)
