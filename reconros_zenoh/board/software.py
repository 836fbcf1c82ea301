"""What a software callback is written against."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from inspect import isasyncgenfunction, iscoroutinefunction, isgeneratorfunction
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from reconros_zenoh.board.os_resources import Condition, Mailbox, Mutex, Semaphore, checked
from reconros_zenoh.board.timing import Native
from reconros_zenoh.errors import CallbackError

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.board.actions import ActionClientSource
    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.clients import ClientSource
    from reconros_zenoh.board.host import Limit
    from reconros_zenoh.board.log import BoardLog
    from reconros_zenoh.board.spans import Timeline
    from reconros_zenoh.board.timing import ExecutionTime
    from reconros_zenoh.board.writers import MessageWriter

R = TypeVar("R")

SoftwareCallback: TypeAlias = "Callable[[Any, SoftwareContext], object]"
"""Called with the message (None for a timer); a service server's callback returns the response."""


def is_plain(function: Callable[..., object]) -> bool:
    """Tell whether a call runs the function: of one with `yield` or `async` it only makes a generator."""
    while isinstance(function, partial):
        function = function.func
    return not any(
        is_of_kind(called)
        for called in (function, type(function).__call__)
        for is_of_kind in (isgeneratorfunction, iscoroutinefunction, isasyncgenfunction)
    )


@dataclass(frozen=True, slots=True)
class SoftwareImplementation:
    """What fills the software field of a ResourceMask: the function, and how long it takes."""

    function: SoftwareCallback
    time: ExecutionTime
    limit: Limit | None


class SoftwareContext:
    """What a software callback can do besides computing; it belongs to one call of it, in one thread.

    `log` is the callback's logger, `started_ns` the time on the board's clock at which the callback began.
    `sequence_number` says which call the response belongs to that started a service client's callback; it is
    what `call` has returned then, and None for all other callbacks.
    """

    def __init__(self, board: Board, callback: str, time: ExecutionTime, sequence_number: int | None) -> None:
        self._board = board
        self._callback = callback
        self.started_ns = board.environment.now
        self.sequence_number = sequence_number
        # What is measured is really computed each time.
        self._really = isinstance(time, Native)
        self._mutexes: dict[Mutex, None] = {}
        self._is_over = False
        self.sends: list[Callable[[Timeline], object]] = []

    @property
    def log(self) -> BoardLog:
        """The callback's logger."""
        return self._board.log.of(self._callback)

    @property
    def now_ns(self) -> int:
        """The present time of the board's clock [ns]: monotonic, in virtual time since the start."""
        return self._board.environment.clock_ns()

    def compute(self, kernel: Callable[..., R], *arguments: object) -> R:
        """Return `kernel(*arguments)` of a pure kernel, which a modelled board need not compute twice."""
        if self._really:
            return kernel(*arguments)
        return self._board.host.compute(kernel, *arguments)

    def publish(self, writer: MessageWriter, message: object) -> None:
        """Publish the message once the callback has run to completion."""
        self.sends.append(partial(writer.send, writer.encode(message)))

    def call(self, client: ClientSource, request: object) -> int:
        """Call the service once the callback has run to completion, and return the call's sequence number.

        Its response starts a CLT callback.
        """
        parts, sequence_number = client.encode(request), client.next_sequence_number()
        self.sends.append(partial(client.send, parts, sequence_number))
        return sequence_number

    def send_goal(self, client: ActionClientSource, goal: object) -> bytes:
        """Send the goal once the callback has run to completion, and return its id.

        What becomes of it starts the callback of the client.
        """
        goal, goal_id = client.copy(goal), client.new_goal_id()
        self.sends.append(lambda _: client.send_goal(goal, goal_id))
        return goal_id

    def cancel_goal(self, client: ActionClientSource, goal_id: bytes) -> None:
        """Ask for a goal to end early, once the callback has run to completion.

        Raises UsageError for what is no goal id.
        """
        checked_id = client.checked_id(goal_id)
        self.sends.append(lambda _: client.cancel_goal(checked_id))

    def mbox_tryget(self, mailbox: Mailbox) -> int | None:
        """Remove the oldest word and return it, or None."""
        return checked(Mailbox, mailbox).try_get()

    def mbox_tryput(self, mailbox: Mailbox, word: int) -> bool:
        """Append a word and return True, or return False."""
        return checked(Mailbox, mailbox).try_put(word)

    def mutex_trylock(self, mutex: Mutex) -> bool:
        """Hold the mutex, until the callback ends at the latest, and return True; or return False.

        Raises CallbackError in a function that runs on although its call is over its limit.
        """
        self._mutexes[checked(Mutex, mutex)] = None
        locked = mutex.try_lock(self)
        # Asked after it is locked: either this sees that the call is over, or its end sees the mutex.
        if self._is_over:
            mutex.release(self)
            raise CallbackError(f"callback {self._callback} is over its limit: it gets no mutex any more.")
        return locked

    def mutex_unlock(self, mutex: Mutex) -> None:
        """Let others have the mutex."""
        checked(Mutex, mutex).unlock(self)

    def cond_signal(self, condition: Condition) -> None:
        """Let one that waits go on."""
        checked(Condition, condition).signal()

    def cond_broadcast(self, condition: Condition) -> None:
        """Let all that wait go on."""
        checked(Condition, condition).broadcast()

    def sem_trywait(self, semaphore: Semaphore) -> bool:
        """Count down and return True, or return False."""
        return checked(Semaphore, semaphore).try_wait()

    def sem_post(self, semaphore: Semaphore) -> None:
        """Count up."""
        checked(Semaphore, semaphore).post()

    def release_mutexes(self) -> None:
        """Let others have every mutex that is still held: the call has ended, maybe with an error."""
        self._is_over = True
        for mutex in list(self._mutexes):
            mutex.release(self)
