"""What a callback is written against, in software and in hardware."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import numpy as np

    from reconros_zenoh.board.bitstream import Bitstream
    from reconros_zenoh.board.endpoints import Event, MessageWriter
    from reconros_zenoh.board.host import Host
    from reconros_zenoh.board.memif import Memif
    from reconros_zenoh.board.osif import Osif
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment

R = TypeVar("R")

SoftwareCallback: TypeAlias = "Callable[[Any, SoftwareContext], object]"
"""Called with the message (None for a timer); a service server's callback returns the response."""

HardwareCallback: TypeAlias = "Callable[[HardwareThread], Generator[Awaitable, object, object]]"
"""A generator; a service server's callback returns the response."""


@dataclass(frozen=True, slots=True)
class HardwareImplementation:
    """What fills a slot's field in a ResourceMask: the bitstream, and what the slot does once it holds it."""

    bitstream: Bitstream
    callback: HardwareCallback


@dataclass(frozen=True, slots=True)
class Publication:
    """A message that a callback published, as `MessageWriter.encode` returned it."""

    writer: MessageWriter
    encoded: Any


class SoftwareContext:
    """What a software callback can do besides computing; it belongs to one call of it, in one thread."""

    def __init__(self, host: Host, started_ns: int) -> None:
        """`started_ns` is the time on the board's clock at which the callback is started."""
        self._host = host
        self.started_ns = started_ns
        self.publications: list[Publication] = []

    def compute(self, kernel: Callable[..., R], *arguments: object) -> R:
        """Return `kernel(*arguments)` of a pure kernel, which need not be computed twice in virtual time."""
        return self._host.compute(kernel, *arguments)

    def publish(self, writer: MessageWriter, message: object) -> None:
        """Publish the message once the callback has run to completion."""
        self.publications.append(Publication(writer, writer.encode(message)))


class HardwareThread:
    """The interface of a hardware thread: one MEMIF, one OSIF, and the computation in between.

    A hardware callback is a generator over it, written like the listings of the paper:
    `image = yield from thread.mem_read(message.data)`. Every call is charged in the model.
    Source: ReconROS Executor, Section IV, Listings 2 and 3.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        event: Event,
        *,
        memif: Memif,
        osif: Osif,
        host: Host,
        compute_ns: int | None,
    ) -> None:
        self._environment = environment
        self._event = event
        self._memif = memif
        self._osif = osif
        self._host = host
        self._compute_ns = compute_ns
        self._timeline = event.timeline

    def get_init_data(self) -> Generator[Awaitable, object, Any]:
        """Return the message that the callback was started with: THREAD_GETINITDATA."""
        yield from self._osif.call()
        self._timeline.mark("osif")
        return self._event.message

    def mem_read(self, data: np.ndarray[Any, Any]) -> Generator[Awaitable, object, np.ndarray[Any, Any]]:
        """Return the array once it has come from main memory into the slot: MEM_READ.

        What came over a hardware-mapped topic is in the slot already.
        """
        if not self._event.in_slot:
            yield from self._memif.transfer(data.nbytes)
            self._timeline.mark("memif")
        return data

    def mem_write(
        self, data: np.ndarray[Any, Any], to: MessageWriter | None = None
    ) -> Generator[Awaitable, object, None]:
        """Return when the array has gone from the slot to main memory: MEM_WRITE.

        `to` is the writer that will publish it: for a hardware-mapped topic it stays in the slot.
        """
        if to is None or not to.in_slot:
            yield from self._memif.transfer(data.nbytes)
            self._timeline.mark("memif")

    def compute(self, kernel: Callable[..., R], *arguments: object) -> Generator[Awaitable, object, R]:
        """Return `kernel(*arguments)` of a pure kernel when the slot has computed it."""
        future = self._host.start(kernel, partial(self._host.compute, kernel, *arguments))
        if self._compute_ns is None:
            result: R = yield from self._host.result(future)
            self._timeline.mark("execution")
            return result
        yield self._environment.timeout(self._compute_ns)
        self._timeline.mark("execution")
        result = yield from self._host.late_result(future)
        self._timeline.mark("overrun")
        return result

    def publish(self, writer: MessageWriter, message: object) -> Generator[Awaitable, object, None]:
        """Publish the message as its topic is mapped: through the delegate, or onto a stream."""
        yield from writer.publish(message, self._osif, self._timeline)
