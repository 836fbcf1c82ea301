"""The executors of the paper written down naively: one list, one loop, no bits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass
class ReferenceCallback:
    """What an executor knows of a callback."""

    name: str
    kind: str
    resources: frozenset[int]
    events: list[int] = field(default_factory=list)
    running: bool = False

    def could_start(self, resource: int) -> bool:
        return bool(self.events) and not self.running and resource in self.resources


class ReferenceReconros:
    """ReconROS Executor, Section III-B: Position per worker and list."""

    def __init__(self, callbacks: list[ReferenceCallback]) -> None:
        self._callbacks = callbacks
        self._position: dict[tuple[object, str], int] = {}

    def choose(self, worker: object, resource: int) -> ReferenceCallback | None:
        for callback in self._list("TMR"):
            if callback.could_start(resource):
                return callback
        for kind in ("SUB", "SRV", "CLT") * 2:
            callbacks = self._list(kind)
            start = self._position.get((worker, kind), len(callbacks)) + 1
            for position in range(start, len(callbacks)):
                if callbacks[position].could_start(resource):
                    self._position[worker, kind] = position
                    return callbacks[position]
            self._position[worker, kind] = -1
        return None

    def _list(self, kind: str) -> list[ReferenceCallback]:
        return [callback for callback in self._callbacks if callback.kind == kind]


class ReferenceStandard:
    """ReconROS Executor, Section II-B, Fig. 2: one readySet for all workers."""

    def __init__(self, callbacks: list[ReferenceCallback]) -> None:
        kinds = ("TMR", "SUB", "SRV", "CLT")
        self._callbacks = sorted(callbacks, key=lambda callback: kinds.index(callback.kind))
        self._ready_set: list[ReferenceCallback] = []

    def choose(self, worker: object, resource: int) -> ReferenceCallback | None:
        for callback in self._could_start(resource):
            if callback.kind == "TMR":
                return callback
        if not any(callback.could_start(resource) for callback in self._ready_set):
            self._ready_set = list(self._could_start(resource))
        for callback in self._ready_set:
            if callback.could_start(resource):
                self._ready_set.remove(callback)
                return callback
        return None

    def _could_start(self, resource: int) -> Iterator[ReferenceCallback]:
        return (callback for callback in self._callbacks if callback.could_start(resource))
