"""What a hardware callback is written against."""

from __future__ import annotations

import reprlib
from dataclasses import dataclass
from functools import partial
from operator import index
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, overload

import numpy as np

from reconros_zenoh.board.address_space import UnmappedError
from reconros_zenoh.board.delegate_calls import DelegateCalls
from reconros_zenoh.board.host import measured
from reconros_zenoh.board.init_data import InitData
from reconros_zenoh.board.noted_calls import noted
from reconros_zenoh.board.timing import Native, check_cycles, cycles_ns
from reconros_zenoh.errors import PageFaultError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from numpy.typing import NDArray

    from reconros_zenoh.board.actions import ActionClientSource
    from reconros_zenoh.board.bitstream import Bitstream
    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.clients import ClientSource
    from reconros_zenoh.board.host import Limit
    from reconros_zenoh.board.init_data import Array
    from reconros_zenoh.board.slots import Slot
    from reconros_zenoh.board.sources import Event
    from reconros_zenoh.board.timing import ExecutionTime
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.rmw.action_server import GoalHandle
    from reconros_zenoh.ros.types import MessageType

R = TypeVar("R")
_MOST_STEPS = 100

HardwareCallback: TypeAlias = "Callable[[HardwareThread], Generator[Awaitable, object, object]]"
"""A generator; a service server's callback returns the response."""


@dataclass(frozen=True, slots=True)
class HardwareImplementation:
    """What fills a slot's field in a ResourceMask: the bitstream, and what the slot does once it holds it."""

    bitstream: Bitstream
    callback: HardwareCallback
    time: ExecutionTime
    limit: Limit | None


class ThreadExit(Exception):  # noqa: N818 - it ends the callback as SystemExit ends a program
    """Ends a hardware callback with what it answers."""

    def __init__(self, response: object) -> None:
        super().__init__()
        self.response = response


class HardwareThread(DelegateCalls):
    """The interface of a hardware thread: one MEMIF, one OSIF, and the computation in between.

    A hardware callback is a generator over it, written like the listings of the paper:
    `image = yield from thread.mem_read(message.data)`. Every call is charged in the model.
    `sequence_number` is as in a `SoftwareContext`: it came with the init data.
    Source: ReconROS Executor, Section IV, Listings 2 and 3.
    """

    def __init__(
        self,
        board: Board,
        callback: str,
        slot: Slot,
        event: Event,
        implementation: HardwareImplementation,
    ) -> None:
        super().__init__(board.osif, event.timeline)
        self._board = board
        self._environment = board.environment
        self._callback = callback
        self._slot = slot
        self._time = implementation.time
        self._limit = implementation.limit
        self._computations = 0
        self.sequence_number = event.sequence_number
        self._in_slot = event.in_slot
        self._message = (
            event.message
            if event.message_type is None
            else InitData(event.message, event.message_type, board.memory)
        )

    @noted
    def get_init_data(self) -> Generator[Awaitable, object, Any]:
        """Return what the callback was started with, a message with its address: THREAD_GETINITDATA.

        A message of a topic or a request of a service is an `InitData`; a timer's is None.
        """
        yield from self._call()
        return self._message

    def offsetof(self, message_type: MessageType, path: str) -> int:
        """Return where a field stands in the C struct of a message, as `CLayout.offsetof`: OFFSETOF."""
        return self._board.memory.layout.offsetof(message_type, path)

    @overload
    def mem_read(self, source: Array) -> Generator[Awaitable, object, Array]: ...
    @overload
    def mem_read(
        self, source: int | np.integer[Any] | InitData, size: int
    ) -> Generator[Awaitable, object, NDArray[np.uint32]]: ...
    @overload
    def mem_read(
        self, source: int | np.integer[Any] | InitData, size: int, dtype: type[np.generic]
    ) -> Generator[Awaitable, object, Array]: ...
    @noted
    def mem_read(
        self,
        source: Array | int | np.integer[Any] | InitData,
        size: int | None = None,
        dtype: type[np.generic] = np.uint32,
    ) -> Generator[Awaitable, object, Array]:
        """Return the array once it has come from main memory into the slot: MEM_READ.

        The source is an array, such as a field of the message, or an address: then `size` bytes from there on
        come as numbers of `dtype`. A message that came over a hardware-mapped topic is in the slot already:
        its arrays, views of them, and its blocks at their addresses cost nothing, copies and all else do.
        Raises PageFaultError for bytes that are not all in one block of memory, UsageError for what is
        neither an array nor an address with a size.
        """
        if isinstance(source, np.ndarray):
            data: Array = source
        else:
            try:
                source, size = index(source), index(size)  # type: ignore[arg-type] # None is none
            except TypeError:
                raise UsageError(
                    f"mem_read of a {type(source).__name__} with the size {size!r}: give an array, which "
                    'of a field that is a number is message.array("field"), or an address and how many bytes.'
                ) from None
            # What the slot holds does not change with the memory.
            data = self._mapped(source, size).view(dtype).copy()
        if not (self._in_slot and isinstance(self._message, InitData) and self._message.holds(source)):
            yield from self._board.memif.transfer(data.nbytes)
            self._timeline.mark("memif")
        return data

    @noted
    def mem_write(
        self, data: Array, to: int | np.integer[Any] | InitData | MessageWriter | None = None
    ) -> Generator[Awaitable, object, None]:
        """Return when the array has gone from the slot to main memory: MEM_WRITE.

        `to` is the address of its first byte, or the writer that will publish it: for a hardware-mapped topic
        it stays in the slot. Without `to` it is what the callback returns next. Raises PageFaultError for
        bytes that are not all in one block of memory, UsageError for what is no array.
        """
        if not isinstance(data, (np.ndarray, np.generic)):
            raise UsageError(
                f"mem_write of {reprlib.repr(data)}: give an array, as np.array([1], np.uint32)."
            )
        if isinstance(to, (int, np.integer, InitData)):
            content = np.ascontiguousarray(data).reshape(-1).view(np.uint8)
            try:
                self._board.memory.write(int(to), content)
            except UnmappedError:
                raise self._page_fault("write", int(to), len(content)) from None
        elif to is not None and to.in_slot:
            return
        yield from self._board.memif.transfer(data.nbytes)
        self._timeline.mark("memif")

    @noted
    def compute(self, kernel: Callable[..., R], *arguments: object) -> Generator[Awaitable, object, R]:
        """Return `kernel(*arguments)` of a pure kernel when the slot has computed it."""
        host = self._board.host
        if isinstance(self._time, Native):
            return (yield from self._compute_as_measured(self._time.factor, kernel, *arguments))
        task = partial(host.compute, kernel, *arguments)
        if self._time is None:
            result: R = yield from host.run(self._next_step(), task, limit=self._limit)
            self._timeline.mark("execution")
            return result
        future = host.start(self._next_step(), task, limit=self._limit)
        yield self._environment.timeout(self._time.ns)
        self._timeline.mark("execution")
        result = yield from host.late_result(future)
        self._timeline.mark("overrun")
        return result

    @noted
    def compute_cycles(self, cycles: int) -> Generator[Awaitable, object, None]:
        """Return when so many cycles of the slot's clock have passed; at once where nothing is modelled.

        Raises UsageError for less than none.
        """
        check_cycles("compute_cycles", cycles)
        if self._time is not None:
            yield self._environment.timeout(cycles_ns(cycles, self._slot.clock_hz))
            self._timeline.mark("execution")

    @noted
    def publish(self, writer: MessageWriter, message: object) -> Generator[Awaitable, object, None]:
        """Publish the message as its topic is mapped: through the delegate, or onto a stream.

        The init data is published as it stands in memory, with what the callback has written there.
        """
        if isinstance(message, InitData):
            message = self._in_memory(message)
        yield from writer.publish(message, self._timeline)

    @noted
    def call(self, client: ClientSource, request: object) -> Generator[Awaitable, object, int]:
        """Call a service through the delegate and return the call's sequence number.

        Its response starts a CLT callback.
        """
        yield from self._call()
        parts, sequence_number = client.encode(request), client.next_sequence_number()
        client.send(parts, sequence_number, self._timeline.fork())
        return sequence_number

    @noted
    def send_goal(self, client: ActionClientSource, goal: object) -> Generator[Awaitable, object, bytes]:
        """Send the goal through the delegate and return its id; what becomes of it starts a CLT callback."""
        yield from self._call()
        goal_id = client.new_goal_id()
        client.send_goal(goal, goal_id)
        return goal_id

    @noted
    def cancel_goal(self, client: ActionClientSource, goal_id: bytes) -> Generator[Awaitable, object, None]:
        """Ask through the delegate for a goal to end early."""
        yield from self._call()
        client.cancel_goal(goal_id)

    @noted
    def feedback(self, handle: GoalHandle, feedback: object) -> Generator[Awaitable, object, None]:
        """Publish feedback on the goal that the callback serves through the delegate."""
        yield from self._call()
        handle.feedback(feedback)

    @noted
    def is_cancel_requested(self, handle: GoalHandle) -> Generator[Awaitable, object, bool]:
        """Ask the delegate whether the goal that the callback serves shall end early."""
        yield from self._call()
        return handle.is_cancel_requested

    @noted
    def exit(self, response: object = None) -> Generator[Awaitable, object, None]:
        """End the callback, whose answer is `response`: THREAD_EXIT. What stands behind it does not run."""
        yield from self._call()
        raise ThreadExit(response)

    def close(self) -> None:
        """Give back what the call has taken; called when the callback has ended in any way."""
        self.release_mutexes()
        if isinstance(self._message, InitData):
            self._message.release()

    def _compute_as_measured(
        self, factor: float, kernel: Callable[..., R], *arguments: object
    ) -> Generator[Awaitable, object, R]:
        host, started_ns = self._board.host, self._environment.now
        task = partial(host.compute, measured, kernel, *arguments)
        result: R
        result, took_ns = yield from host.run(self._next_step(), task, limit=self._limit)
        yield from host.until(started_ns + round(took_ns * factor))
        self._timeline.mark("execution")
        return result

    def _next_step(self) -> tuple[str, int]:
        """Return the task of the next computation; its kernel may be a new object in each call.

        Those after the hundredth of a call are one task, because a callback may go on for ever.
        """
        self._computations = min(self._computations + 1, _MOST_STEPS)
        return self._callback, self._computations

    def _in_memory(self, init: InitData) -> Any:
        try:
            return init.in_memory()
        except UnmappedError:
            raise self._page_fault("publish", init.address, 0) from None

    def _mapped(self, address: int, size: int) -> NDArray[np.uint8]:
        try:
            return self._board.memory.read(address, size)
        except UnmappedError:
            raise self._page_fault("read", address, size) from None

    def _page_fault(self, access: str, address: int, size: int) -> PageFaultError:
        return PageFaultError(self._callback, self._slot.slot_id, access, address, size)
