"""The ReconROS executor (ReconROS Executor, Section III-B)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.executor.callbacks import CallbackKind, CallbackLists, lowest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from reconros_zenoh.executor.callbacks import Dispatch

_WITH_POSITION = (CallbackKind.SUB, CallbackKind.SRV, CallbackKind.CLT)
_BEFORE_THE_FIRST = -1


class OffsetVector:
    """One worker's `Position` in each list but the timers': the callback it served last.

    A search starts behind `Position`. When it meets the end of the list, `Position` wraps to the beginning
    and the worker goes on to the next list, so a subscriber that is always ready cannot starve the service
    servers behind it.
    """

    def __init__(self, lengths: Sequence[int]) -> None:
        """`lengths` are those of the lists, by kind."""
        # The paper initialises Position with the length of the list, so that the first search starts over.
        self._position = {kind: lengths[kind] for kind in _WITH_POSITION}

    def wrap(self) -> None:
        """Do what searches of empty sets do: let every `Position` wrap."""
        self._position = dict.fromkeys(_WITH_POSITION, _BEFORE_THE_FIRST)

    def search(self, kind: CallbackKind, ready: int) -> int | None:
        """Return the first set bit behind `Position` and move there; wrap and return None at the end."""
        behind = ready >> (self._position[kind] + 1)
        if not behind:
            self._position[kind] = _BEFORE_THE_FIRST
            return None
        index = self._position[kind] + 1 + lowest(behind)
        self._position[kind] = index
        return index


class ReconrosExecutor(CallbackLists):
    """Hands ready callbacks to software and hardware workers, whose number it need not know.

    A worker asks with `select`, runs what it got to completion, and says so with `finish`. Timers come first,
    in the order of registration; then subscribers, service servers and service clients, each behind the
    worker's own OffsetVector. No callback runs twice at once and none runs where its ResourceMask has no
    field.
    """

    def __init__(self) -> None:
        super().__init__()
        self._offsets: dict[object, OffsetVector] = {}

    def select(self, worker: object, resource: int) -> Dispatch | None:
        """Return the callback that this worker of `resource` must run now, or None when none is ready."""
        ready = self._ready[resource]
        if timers := ready[CallbackKind.TMR]:
            return self.take(CallbackKind.TMR, lowest(timers), resource)
        offsets = self._offsets.get(worker)
        if offsets is None:
            offsets = self._offsets[worker] = OffsetVector(list(map(len, self._entries)))
        if not any(ready):
            offsets.wrap()
            return None
        # Twice: the first round may only have wrapped every Position.
        for kind in _WITH_POSITION * 2:
            index = offsets.search(kind, ready[kind])
            if index is not None:
                return self.take(kind, index, resource)
        return None
