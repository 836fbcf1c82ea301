"""What a hardware thread asks of the operating system through its delegate thread."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from reconros_zenoh.board.noted_calls import NotedCalls, noted
from reconros_zenoh.board.os_resources import Condition, Mailbox, Mutex, Semaphore, checked

if TYPE_CHECKING:
    from collections.abc import Generator

    from reconros_zenoh.board.osif import Osif
    from reconros_zenoh.board.spans import Timeline
    from reconros_zenoh.clock.activity import Awaitable

R = TypeVar("R")


class DelegateCalls(NotedCalls):
    """The calls of ReconOS to mailboxes, mutexes, conditions and semaphores: base of `HardwareThread`.

    Each costs one call through the delegate thread (stage `osif`); what a call waits for counts as `blocked`.
    UsageError for what is no object of its kind.
    """

    def __init__(self, osif: Osif, timeline: Timeline) -> None:
        super().__init__()
        self._osif = osif
        self._timeline = timeline
        self._mutexes: dict[Mutex, None] = {}

    @noted
    def mbox_get(self, mailbox: Mailbox) -> Generator[Awaitable, object, int]:
        """Remove the oldest word, once there is one, and return it: MBOX_GET."""
        yield from self._call()
        return (yield from self._blocked("a word in a mailbox", checked(Mailbox, mailbox).get()))

    @noted
    def mbox_put(self, mailbox: Mailbox, word: int) -> Generator[Awaitable, object, None]:
        """Append a word once there is room: MBOX_PUT."""
        yield from self._call()
        yield from self._blocked("room in a mailbox", checked(Mailbox, mailbox).put(word))

    @noted
    def mbox_tryget(self, mailbox: Mailbox) -> Generator[Awaitable, object, int | None]:
        """Remove the oldest word and return it, or None: MBOX_TRYGET."""
        yield from self._call()
        return checked(Mailbox, mailbox).try_get()

    @noted
    def mbox_tryput(self, mailbox: Mailbox, word: int) -> Generator[Awaitable, object, bool]:
        """Append a word and return True, or return False: MBOX_TRYPUT."""
        yield from self._call()
        return checked(Mailbox, mailbox).try_put(word)

    @noted
    def mutex_lock(self, mutex: Mutex) -> Generator[Awaitable, object, None]:
        """Hold the mutex once nobody else does: MUTEX_LOCK."""
        yield from self._call()
        self._mutexes[checked(Mutex, mutex)] = None
        yield from self._blocked("a mutex", mutex.lock(self))

    @noted
    def mutex_trylock(self, mutex: Mutex) -> Generator[Awaitable, object, bool]:
        """Hold the mutex and return True, or return False: MUTEX_TRYLOCK."""
        yield from self._call()
        self._mutexes[checked(Mutex, mutex)] = None
        return mutex.try_lock(self)

    @noted
    def mutex_unlock(self, mutex: Mutex) -> Generator[Awaitable, object, None]:
        """Let others have the mutex: MUTEX_UNLOCK."""
        yield from self._call()
        checked(Mutex, mutex).unlock(self)

    @noted
    def cond_wait(self, condition: Condition) -> Generator[Awaitable, object, None]:
        """Let others have the mutex, wait for a signal, and hold the mutex again: COND_WAIT."""
        yield from self._call()
        yield from self._blocked("a condition", checked(Condition, condition).wait(self))

    @noted
    def cond_signal(self, condition: Condition) -> Generator[Awaitable, object, None]:
        """Let one that waits go on: COND_SIGNAL."""
        yield from self._call()
        checked(Condition, condition).signal()

    @noted
    def cond_broadcast(self, condition: Condition) -> Generator[Awaitable, object, None]:
        """Let all that wait go on: COND_BROADCAST."""
        yield from self._call()
        checked(Condition, condition).broadcast()

    @noted
    def sem_wait(self, semaphore: Semaphore) -> Generator[Awaitable, object, None]:
        """Count down once the semaphore is above 0: SEM_WAIT."""
        yield from self._call()
        yield from self._blocked("a semaphore", checked(Semaphore, semaphore).wait())

    @noted
    def sem_post(self, semaphore: Semaphore) -> Generator[Awaitable, object, None]:
        """Count up: SEM_POST."""
        yield from self._call()
        checked(Semaphore, semaphore).post()

    def release_mutexes(self) -> None:
        """Let others have every mutex that is still held: the call has ended, maybe with an error."""
        for mutex in self._mutexes:
            mutex.release(self)

    def _blocked(self, what: str, wait: Generator[Awaitable, object, R]) -> Generator[Awaitable, object, R]:
        self._timeline.waits_for = what
        try:
            result = yield from wait
        finally:  # the callback may go on after an error
            self._timeline.waits_for = ""
        self._timeline.mark("blocked")
        return result

    def _call(self) -> Generator[Awaitable, object, None]:
        yield from self._osif.call()
        self._timeline.mark("osif")
