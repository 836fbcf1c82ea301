"""The callbacks registered at an executor and the four lists they stand in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reconros_zenoh.executor.resource_mask import ResourceMask


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
    """A callback to run now on `resource`: its message was taken and nobody else runs it."""

    entry: CallbackEntry
    resource: int
    message: object

    @property
    def implementation(self) -> object:
        """What the worker starts: a function, or a bitstream."""
        return self.entry.mask.implementations[self.resource]


class CallbackList:
    """The callbacks of one kind in the order of registration.

    `ready` says which of them a worker of a resource could start now: a set of bits, bit i for entry i, so
    that a search costs the same for one callback and for hundreds.
    """

    def __init__(self) -> None:
        self._entries: list[CallbackEntry] = []
        self.ready: defaultdict[int, int] = defaultdict(int)

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[CallbackEntry]:
        return iter(self._entries)

    def __getitem__(self, index: int) -> CallbackEntry:
        return self._entries[index]

    def append(self, entry: CallbackEntry) -> None:
        """Register the entry at the end of the list."""
        entry.index = len(self._entries)
        self._entries.append(entry)
        self.refresh(entry)

    def refresh(self, entry: CallbackEntry) -> None:
        """Note whether the entry could start now: an event waits and it does not run already."""
        bit = 1 << entry.index
        if not entry.running and entry.source.is_ready():
            for resource in entry.mask.implementations:
                self.ready[resource] |= bit
        else:
            for resource in entry.mask.implementations:
                self.ready[resource] &= ~bit


class CallbackLists(ABC):
    """The four lists of an executor's main thread: timers, subscribers, service servers, service clients.

    Base of both executors, which differ in what they `select`.
    """

    def __init__(self) -> None:
        self._lists = {kind: CallbackList() for kind in CallbackKind}
        self._names: set[str] = set()

    def __getitem__(self, kind: CallbackKind) -> CallbackList:
        return self._lists[kind]

    def __iter__(self) -> Iterator[CallbackEntry]:
        for callbacks in self._lists.values():
            yield from callbacks

    def add(self, entry: CallbackEntry) -> None:
        """Register the entry, before any worker asks; raise ValueError when its name is taken."""
        if entry.name in self._names:
            raise ValueError(f"a callback named {entry.name!r} is registered already")
        self._names.add(entry.name)
        self._lists[entry.kind].append(entry)

    def refresh(self, entry: CallbackEntry) -> None:
        """Note that an event of the entry has come or gone."""
        self._lists[entry.kind].refresh(entry)

    @abstractmethod
    def select(self, worker: object, resource: int) -> Dispatch | None:
        """Return the callback that this worker of `resource` must run now, or None when none is ready."""

    def take(self, entry: CallbackEntry, resource: int) -> Dispatch:
        """Take the entry's oldest event and mark it running until `finish`."""
        message = entry.source.take()
        entry.running = True
        self._lists[entry.kind].refresh(entry)
        return Dispatch(entry, resource, message)

    def finish(self, dispatch: Dispatch) -> None:
        """Note that the dispatched callback has run to completion."""
        entry = dispatch.entry
        entry.running = False
        self._lists[entry.kind].refresh(entry)


def lowest(bits: int) -> int:
    """Return the index of the lowest set bit of a set that is not empty."""
    return (bits & -bits).bit_length() - 1
