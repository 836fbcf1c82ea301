"""The operating system's objects that callbacks share: mailboxes, mutexes, conditions, semaphores, memory.

They are those of `build.cfg` (mbox, mutex, cond, sem, mem), one of each name on a board, for hardware and
software callbacks alike. A hardware callback may block in one, because its delegate thread does that for it.
A software callback is a plain function in a thread of the host, where nothing can wait in board time: it has
the calls that do not block. Those take effect when the host runs the function, which in the model is the
moment when the callback starts.

Threads: whatever does not wait may be called from any thread; waiting belongs to the event loop.
"""

from __future__ import annotations

import reprlib
import threading
from collections import deque
from dataclasses import dataclass
from functools import partial
from operator import index
from typing import TYPE_CHECKING, TypeVar

from reconros_zenoh.clock.activity import Signal
from reconros_zenoh.errors import CallbackError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import numpy as np
    from numpy.typing import NDArray

    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment

R = TypeVar("R")


def checked(kind: type[R], given: object) -> R:
    """Return what a callback has given for an object of this kind; raise UsageError unless it is one."""
    if isinstance(given, kind):
        return given
    raise UsageError(
        f"{reprlib.repr(given)} is no {kind.__name__}. Give a resource of build.cfg, as app.mbox, app.mutex, "
        "app.cond or app.sem returns it."
    )


class _Waiters:
    """Those who wait, first come, first served."""

    def __init__(self, environment: VirtualEnvironment) -> None:
        self._environment = environment
        self._waiting: deque[tuple[Callable[[], bool], Signal]] = deque()

    def until(self, attempt: Callable[[], bool]) -> Generator[Awaitable, object, None]:
        """Return once `attempt` has returned True, which is tried when those before have gone."""
        if not self._waiting and attempt():
            return
        turn = Signal()
        entry = (attempt, turn)
        self._waiting.append(entry)
        try:
            yield turn
        finally:
            if entry in self._waiting:  # it was stopped while it waited
                self._waiting.remove(entry)

    def tell(self) -> None:
        """Let those who wait try again; from any thread."""
        self._environment.post(self._try)

    def _try(self) -> None:
        while self._waiting and self._waiting[0][0]():
            self._waiting.popleft()[1].fire()


class Mailbox:
    """A queue of at most `size` words of 32 bits (mbox)."""

    def __init__(self, environment: VirtualEnvironment, size: int) -> None:
        self._words: deque[int] = deque()
        self._size = size
        self._lock = threading.Lock()
        self._getters = _Waiters(environment)
        self._putters = _Waiters(environment)

    def try_put(self, word: int) -> bool:
        """Append a word; False when the mailbox is full. UsageError for what is no whole number."""
        return self._try_append(_word(word))

    def _try_append(self, word: int) -> bool:
        with self._lock:
            if len(self._words) >= self._size:
                return False
            self._words.append(word)
        self._getters.tell()
        return True

    def try_get(self) -> int | None:
        """Remove the oldest word and return it; None when the mailbox is empty."""
        with self._lock:
            if not self._words:
                return None
            word = self._words.popleft()
        self._putters.tell()
        return word

    def put(self, word: int) -> Generator[Awaitable, object, None]:
        """Append a word once there is room; raise UsageError as `try_put`, also where there is none."""
        return self._putters.until(partial(self._try_append, _word(word)))

    def get(self) -> Generator[Awaitable, object, int]:
        """Remove the oldest word, once there is one, and return it."""
        words: list[int] = []

        def attempt() -> bool:
            word = self.try_get()
            if word is not None:
                words.append(word)
            return word is not None

        yield from self._getters.until(attempt)
        return words[0]


def _word(given: int) -> int:
    try:
        # One of an array may have a type that the mask does not fit.
        return index(given) & 0xFFFF_FFFF
    except TypeError:
        raise UsageError(f"{reprlib.repr(given)} is no word of a mailbox. Give a whole number.") from None


class Mutex:
    """Held by one call of a callback at a time (mutex); what is held when the call ends is released."""

    def __init__(self, environment: VirtualEnvironment) -> None:
        self._holder: object | None = None
        self._lock = threading.Lock()
        self._waiters = _Waiters(environment)

    def try_lock(self, holder: object) -> bool:
        """Give the mutex to `holder`; False when somebody holds it."""
        with self._lock:
            if self._holder is not None:
                return False
            self._holder = holder
            return True

    def lock(self, holder: object) -> Generator[Awaitable, object, None]:
        """Give the mutex to `holder` once nobody holds it."""
        return self._waiters.until(lambda: self.try_lock(holder))

    def unlock(self, holder: object) -> None:
        """Take the mutex from `holder`; raise CallbackError when it does not hold it."""
        if not self.release(holder):
            raise CallbackError("a mutex was unlocked by a callback that does not hold it.")

    def release(self, holder: object) -> bool:
        """Take the mutex from `holder`; False when it does not hold it."""
        with self._lock:
            if self._holder is not holder:
                return False
            self._holder = None
        self._waiters.tell()
        return True


class Condition:
    """Lets callbacks that hold its mutex wait until another one signals (cond)."""

    def __init__(self, environment: VirtualEnvironment, mutex: Mutex) -> None:
        self._environment = environment
        self.mutex = mutex
        self._waiting: deque[Signal] = deque()

    def wait(self, holder: object) -> Generator[Awaitable, object, None]:
        """Unlock the mutex, wait for a signal, and lock it again; CallbackError when it is not held."""
        self.mutex.unlock(holder)
        turn = Signal()
        self._waiting.append(turn)
        try:
            yield turn
        finally:
            if turn in self._waiting:  # it was stopped while it waited
                self._waiting.remove(turn)
        yield from self.mutex.lock(holder)

    def signal(self) -> None:
        """Let the one that has waited longest go on, if there is one; from any thread."""
        self._environment.post(self._wake, 1)

    def broadcast(self) -> None:
        """Let all that wait now go on; from any thread."""
        self._environment.post(self._wake, None)

    def _wake(self, most: int | None) -> None:
        for _ in range(len(self._waiting) if most is None else min(most, len(self._waiting))):
            self._waiting.popleft().fire()


class Semaphore:
    """A counter that never falls below 0 (sem)."""

    def __init__(self, environment: VirtualEnvironment, value: int) -> None:
        self._value = value
        self._lock = threading.Lock()
        self._waiters = _Waiters(environment)

    def try_wait(self) -> bool:
        """Count down; False when it is 0."""
        with self._lock:
            if not self._value:
                return False
            self._value -= 1
            return True

    def wait(self) -> Generator[Awaitable, object, None]:
        """Count down once it is above 0."""
        return self._waiters.until(self.try_wait)

    def post(self) -> None:
        """Count up; from any thread."""
        with self._lock:
            self._value += 1
        self._waiters.tell()


@dataclass(frozen=True, slots=True, eq=False)
class SharedMemory:
    """Words of 32 bits in main memory (mem): `words` for software, `address` for hardware."""

    address: int
    words: NDArray[np.uint32]
