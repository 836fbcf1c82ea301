"""The callbacks registered at an executor and the four lists they stand in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple, Protocol

from reconros_zenoh.executor.resource_mask import ResourceMask

if TYPE_CHECKING:
    from collections.abc import Iterator


class CallbackKind(IntEnum):
    """The four categories of callbacks, in the order in which an executor looks for them."""

    TMR = 0
    SUB = 1
    SRV = 2
    CLT = 3


class EventSource(Protocol):
    """What makes a callback ready: a timer, or the queue of a reader."""

    def is_ready(self) -> bool:
        """Tell whether an event waits."""

    def take(self) -> object:
        """Remove the oldest event and return it; called only when one waits."""


@dataclass(slots=True)
class CallbackEntry:
    """One registered callback (ReconROS Executor, Section III-B).

    `name` is its unique identifier; `index` its place in the list of its kind. The message is not a field: it
    stays in `source` until a worker takes it.
    """

    name: str
    kind: CallbackKind
    mask: ResourceMask
    source: EventSource
    index: int = field(default=-1, init=False)
    running: bool = field(default=False, init=False)


class Dispatch(NamedTuple):
    """A callback to run now: its message was taken and nobody else runs it.

    `implementation` is what the worker starts: a function, or a bitstream.
    """

    entry: CallbackEntry
    implementation: object
    message: object


class CallbackLists(ABC):
    """The four lists of an executor's main thread: timers, subscribers, service servers, service clients.

    Base of both executors, which differ in what they `select`. `_entries` are the callbacks of each kind in
    the order of registration. `_ready` says for each resource and kind which of them a worker could start
    now: a set of bits, bit i for entry i, so that a search costs the same for one callback and for hundreds.
    """

    def __init__(self) -> None:
        self._entries: list[list[CallbackEntry]] = [[] for _ in CallbackKind]
        self._ready: defaultdict[int, list[int]] = defaultdict(lambda: [0] * len(CallbackKind))
        self._names: set[str] = set()

    def __iter__(self) -> Iterator[CallbackEntry]:
        return chain.from_iterable(self._entries)

    def add(self, entry: CallbackEntry) -> None:
        """Register the entry, before any worker asks; raise ValueError when its name is taken."""
        if entry.name in self._names:
            raise ValueError(f"a callback named {entry.name!r} is registered already")
        self._names.add(entry.name)
        entry.index = len(self._entries[entry.kind])
        self._entries[entry.kind].append(entry)
        self.refresh(entry)

    def refresh(self, entry: CallbackEntry) -> None:
        """Note whether the entry could start now: an event waits and it does not run already."""
        bit = 1 << entry.index
        if not entry.running and entry.source.is_ready():
            for resource in entry.mask.implementations:
                self._ready[resource][entry.kind] |= bit
        else:
            for resource in entry.mask.implementations:
                self._ready[resource][entry.kind] &= ~bit

    @abstractmethod
    def select(self, worker: object, resource: int) -> Dispatch | None:
        """Return the callback that this worker of `resource` must run now, or None when none is ready."""

    def take(self, kind: CallbackKind, index: int, resource: int) -> Dispatch:
        """Take the oldest event of an entry and mark it running until `finish`."""
        entry = self._entries[kind][index]
        # Before its event is taken: that makes room, and where nothing takes time others go on at once, with
        # its next event or one of theirs, and their workers look for more.
        entry.running = True
        self.refresh(entry)
        message = entry.source.take()
        return Dispatch(entry, entry.mask.implementations[resource], message)

    def finish(self, dispatch: Dispatch) -> None:
        """Note that the dispatched callback has run to completion."""
        dispatch.entry.running = False
        self.refresh(dispatch.entry)

    def close(self) -> None:
        """Let no callback become ready any more."""
        for entry in self:
            entry.mask = ResourceMask({})
        self._ready.clear()


def lowest(bits: int) -> int:
    """Return the index of the lowest set bit of a set that is not empty."""
    return (bits & -bits).bit_length() - 1
