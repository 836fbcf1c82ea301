"""Callbacks whose events the test makes."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from reconros_zenoh.executor.callbacks import CallbackEntry, CallbackKind
from reconros_zenoh.executor.resource_mask import SOFTWARE, ResourceMask

if TYPE_CHECKING:
    from collections.abc import Iterable

    from reconros_zenoh.executor.callbacks import CallbackLists, EventSource


class EventQueue:
    """The queue of a reader: holds events until a worker takes them."""

    def __init__(self, *events: object) -> None:
        self.events = list(events)

    def is_ready(self) -> bool:
        return bool(self.events)

    def take(self) -> object:
        return self.events.pop(0)


class AlwaysReady:
    """Has an event whenever it is asked: 0, 1, 2, ..."""

    def __init__(self) -> None:
        self._events = count()

    def is_ready(self) -> bool:
        return True

    def take(self) -> object:
        return next(self._events)


def implementation(name: str, resource: int) -> str:
    """Return what stands in the ResourceMask of a callback of these tests."""
    return f"{name} for resource {resource}"


def callback(
    name: str, kind: CallbackKind, source: EventSource, resources: Iterable[int] = (SOFTWARE,)
) -> CallbackEntry:
    """Return a callback that may run on the resources."""
    fields = {resource: implementation(name, resource) for resource in resources}
    mask = ResourceMask.of(software=fields.pop(SOFTWARE, None), slots=fields)
    return CallbackEntry(name, kind, mask, source)


def always_ready(executor: CallbackLists, **lists: str) -> None:
    """Register callbacks that are ready all the time: `SUB="a b"` registers the subscribers a and b."""
    for kind, names in lists.items():
        for name in names.split():
            executor.add(callback(name, CallbackKind[kind], AlwaysReady()))


def arrive(executor: CallbackLists, entry: CallbackEntry, event: object = None) -> None:
    """Put an event into the callback's EventQueue and tell the executor."""
    assert isinstance(entry.source, EventQueue)
    entry.source.events.append(event)
    executor.refresh(entry)


def serve(executor: CallbackLists, worker: object = "worker", resource: int = SOFTWARE) -> str | None:
    """Let the worker run one callback to completion and return its name."""
    dispatch = executor.select(worker, resource)
    if dispatch is None:
        return None
    executor.finish(dispatch)
    return dispatch.entry.name


def serve_many(executor: CallbackLists, times: int, worker: object = "worker") -> str:
    """Let the software worker run that many callbacks and return their names."""
    return " ".join(str(serve(executor, worker)) for _ in range(times))
