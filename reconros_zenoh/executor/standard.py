"""The standard ROS 2 executor (ReconROS Executor, Section II-B, Fig. 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.executor.callbacks import CallbackKind, CallbackLists, lowest

if TYPE_CHECKING:
    from reconros_zenoh.executor.callbacks import Dispatch

_COLLECTED = (CallbackKind.SUB, CallbackKind.SRV, CallbackKind.CLT)


class StandardExecutor(CallbackLists):
    """The executor of ROS 2, single-threaded with one worker and multi-threaded with more.

    Ready subscribers, service servers and service clients are collected in a `readySet`; it is served in that
    order and in the order of registration, timers before everything, and only when it holds nothing more that
    could run is a new one collected. All workers share the one readySet.
    """

    def __init__(self) -> None:
        super().__init__()
        self._ready_set = dict.fromkeys(_COLLECTED, 0)

    def select(self, worker: object, resource: int) -> Dispatch | None:  # noqa: ARG002 - every worker is alike
        """Return the callback that a worker must run now, or None when none is ready."""
        if timers := self._ready[resource][CallbackKind.TMR]:
            return self.take(CallbackKind.TMR, lowest(timers), resource)
        return self._from_ready_set(resource) or self._collect_and_select(resource)

    def _from_ready_set(self, resource: int) -> Dispatch | None:
        for kind in _COLLECTED:
            # What was collected may have gone meanwhile: pushed out by a newer event.
            serviceable = self._ready_set[kind] & self._ready[resource][kind]
            if serviceable:
                index = lowest(serviceable)
                self._ready_set[kind] &= ~(1 << index)
                return self.take(kind, index, resource)
        return None

    def _collect_and_select(self, resource: int) -> Dispatch | None:
        for kind in _COLLECTED:
            self._ready_set[kind] = self._ready[resource][kind]
        return self._from_ready_set(resource)
