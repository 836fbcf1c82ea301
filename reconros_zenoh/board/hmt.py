"""Hardware-mapped topics: streams between the hardware nodes of one board.

Source: Gateways, Section 2.2 (fpgaDDS): statically declared streaming networks between hardware threads. A
topic has the key `hmt/<board>/<topic>`; nothing of it is ever in the network, except through its tap.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from reconros_zenoh.board.serial_queue import SerialQueue
from reconros_zenoh.board.sources import Event, Source
from reconros_zenoh.clock.activity import Signal
from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.ros.message_arrays import snapshot
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Hashable

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.spans import Timeline
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.gateway.filters import PublisherFilter
    from reconros_zenoh.ros.types import MessageType
    from reconros_zenoh.transport.base import Parts, Publisher

Policy = Literal["block", "drop"]
FIFO_DEPTH = 2
"""Of a FIFO whose depth is not declared: one message is worked on while the next comes in."""


def hmt_key(board: str, topic: str) -> str:
    """Return the key of a board's hardware-mapped topic of that absolute name."""
    return f"hmt/{board}/{topic.strip('/')}"


@dataclass(frozen=True, slots=True)
class FifoPlan:
    """The FIFO of one subscriber: how many messages it holds, and what happens when it is full.

    "block": the stream stands still until there is room; "drop": the message is lost to this subscriber.
    A message of more than `message_bytes` does not fit (None: any does).
    """

    depth: int = FIFO_DEPTH
    policy: Policy = "block"
    message_bytes: int | None = None


class Streamed(NamedTuple):
    """A message on its way over a stream; `complete` fires when its last word is there.

    `timeline` is the publisher's; of a message in a FIFO it is the reader's, which begins with `complete`.
    `read` fires when its last word has come from where it is read; None where all is there from the start.
    `publisher` wrote it to the stream, for the filters; `sender` sent it first, for the log: the gid of who
    published it in software, or the name of the hardware callback.
    """

    publisher: Hashable
    message: Any
    size: int
    targets: list[Fifo]
    timeline: Timeline
    complete: Signal
    sender: bytes | str | None
    read: Signal | None


class Fifo:
    """One subscriber's end of a stream.

    It discards what `own` does not let pass. `on_ready` is called when a message has come: with its first
    word when `cut_through`, else when its last word has been taken over.
    """

    def __init__(
        self,
        plan: FifoPlan,
        on_ready: Callable[[], None],
        own: PublisherFilter | None,
        *,
        cut_through: bool,
    ) -> None:
        self.plan = plan
        self.on_ready = on_ready
        self.own = own
        self.cut_through = cut_through
        self.dropped = 0
        self.messages: deque[Streamed] = deque()
        self.held = 0
        self.room = Signal()

    @property
    def is_full(self) -> bool:
        """Whether every place is taken, by messages on their way included."""
        return self.held >= self.plan.depth

    @property
    def blocks(self) -> bool:
        """Whether publishers have to wait for room here."""
        return self.is_full and self.plan.policy == "block"

    def reserve(self) -> bool:
        """Take a place for a message, or count that it is lost here for want of one."""
        if self.is_full:
            self.dropped += 1
            return False
        self.held += 1
        return True

    def append(self, streamed: Streamed) -> None:
        """Put a message, whose place is taken already, where its reader finds it."""
        self.messages.append(streamed)
        self.on_ready()

    def take(self) -> Streamed:
        """Remove the oldest message and return it; its place is free."""
        streamed = self.messages.popleft()
        self.release()
        return streamed

    def release(self) -> None:
        """Free a place."""
        self.held -= 1
        room, self.room = self.room, Signal()
        room.fire()


class HardwareTopic:
    """A stream that any number of hardware nodes write to and read from.

    One message passes at a time, to all subscribers at once, in the order in which publishers found room: one
    that has to wait does not keep another from passing, or a gateway that is about to write could not go on
    to read. A publisher publishes one message at a time. A message takes its size through the stream's
    bandwidth; bodies, which must not change any more, are handed over by reference. A subscribing slot
    takes it over in the profile's `hmt.overhead`. `has_callback` says that not only gateways have ends of it.
    """

    def __init__(self, board: Board, topic: str, message_type: MessageType) -> None:
        model = board.profile.model
        if model is not None and model.hmt is None:
            raise UsageError(
                f"profile {board.profile.name!r} has no times for the hardware-mapped topic {topic}. Add a "
                "section [model.hmt] to a copy of the profile, or use the profile zcu104 or native."
            )
        section = model.hmt if model else None
        self.key = hmt_key(board.name, topic)
        self._room = f"room in {topic}"
        self.type = message_type
        self._board = board
        self._overhead_ns = section.overhead.ns if section else 0
        self._ns_per_byte = 1 / section.bandwidth.bytes_per_ns if section else 0.0
        self._passages: SerialQueue[Streamed] = SerialQueue(self._pass, None)
        self._fifos: list[Fifo] = []
        self._tap: SerialQueue[Parts] | None = None
        self.has_callback = False
        self.passed = 0
        self.waits = 0

    @property
    def dropped(self) -> int:
        """How many messages were lost to a subscriber whose FIFO was full."""
        return sum(fifo.dropped for fifo in self._fifos)

    def subscribe(self, fifo: Fifo) -> None:
        """Let every message that passes from now on reach this FIFO."""
        self._fifos.append(fifo)

    def open_tap(self) -> Publisher:
        """Publish what passes on the topic's key, without any cost in the model, until this is closed."""
        publisher = self._board.context.transport.publish(self.key, QosProfile())
        host = self._board.sending_host

        def put(parts: Parts) -> Generator[Awaitable, object, None]:
            yield from host.run(self, publisher.put, parts, None)

        self._tap = SerialQueue(put, QosProfile().depth)
        return publisher

    def publish(
        self,
        publisher: Hashable,
        message: Any,
        size: int,
        timeline: Timeline,
        sender: bytes | str | None = None,
        read: Signal | None = None,
    ) -> Generator[Awaitable, object, None]:
        """Return when the message of `size` bytes on the wire has passed; the others as in `Streamed`.

        It is counted with its timeline. Raise BadMessageError when it is larger than somebody's FIFO.
        """
        for fifo in self._fifos:
            if fifo.plan.message_bytes is not None and size > fifo.plan.message_bytes:
                raise BadMessageError(
                    "fifo_size",
                    f"a message of {size} bytes on {self.key} does not fit a FIFO that is declared for "
                    f"{fifo.plan.message_bytes}. Raise the bytes in build.cfg.",
                )
        fifos = [fifo for fifo in self._fifos if fifo.own is None or fifo.own.passes(publisher)]
        self.waits += any(fifo.blocks for fifo in fifos)
        try:
            while full := next((fifo for fifo in fifos if fifo.blocks), None):
                timeline.waits_for = self._room
                yield full.room
        finally:  # the callback may go on after an error
            timeline.waits_for = ""
        # All places at once: who held one while waiting for another could keep a third from going on.
        targets = [fifo for fifo in fifos if fifo.reserve()]
        streamed = Streamed(publisher, message, size, targets, timeline, Signal(), sender, read)
        self._passages.put(streamed)
        yield streamed.complete
        timeline.mark("hmt")
        self._board.spans.add(timeline)
        if self._tap is not None:
            self._tap.put(self.type.encode(message))

    def _pass(self, streamed: Streamed) -> Generator[Awaitable, object, None]:
        self.passed += 1
        theirs = [(fifo, streamed._replace(timeline=streamed.timeline.follow())) for fifo in streamed.targets]
        for fifo, message in theirs:
            if fifo.cut_through:
                fifo.append(message)
        duration_ns = round(streamed.size * self._ns_per_byte)
        if duration_ns:
            yield self._board.environment.timeout(duration_ns)
        if streamed.read is not None:
            yield streamed.read
        for _, message in theirs:
            message.timeline.begin()
        # First whoever has waited for the last word: a gateway has a longer way to go than the others.
        streamed.complete.fire()
        for fifo, message in theirs:
            if not fifo.cut_through:
                self._hand_over(fifo, message)

    def _hand_over(self, fifo: Fifo, streamed: Streamed) -> None:
        if self._overhead_ns:
            self._board.environment.call_later(self._overhead_ns, fifo.append, streamed)
        else:
            fifo.append(streamed)


class HmtSource(Source):
    """A hardware callback's subscription to a hardware-mapped topic: ready while a message waits."""

    kind = CallbackKind.SUB

    def __init__(self, board: Board, topic: HardwareTopic, plan: FifoPlan) -> None:
        super().__init__()
        topic.has_callback = True
        self.message_type = topic.type
        self._board = board
        self._topic = topic
        self._fifo = Fifo(plan, self._arrived, None, cut_through=False)

    @property
    def dropped(self) -> int:
        """How many messages found the FIFO full."""
        return self._fifo.dropped

    def begin(self) -> None:
        """Subscribe."""
        self._topic.subscribe(self._fifo)

    def is_ready(self) -> bool:
        """Tell whether a message waits."""
        return bool(self._fifo.messages)

    def take(self) -> Event:
        """Remove the oldest message and return it, as it lies in the slot."""
        streamed = self._fifo.take()
        streamed.timeline.mark("queue")
        return Event(streamed.message, streamed.timeline, message_type=self.message_type, in_slot=True)

    def _arrived(self) -> None:
        streamed = self._fifo.messages[-1]
        streamed.timeline.mark("hmt")
        try:
            if self._check is not None:
                self._check(streamed.message)
        except BadMessageError as error:
            self._fifo.messages.pop()
            self._fifo.release()
            self._board.context.rejections.add(self._topic.key, streamed.sender, error)
            return
        self._on_ready()


class HmtWriter:
    """A hardware callback's publisher on a hardware-mapped topic."""

    in_slot = True

    def __init__(self, topic: HardwareTopic) -> None:
        topic.has_callback = True
        self._topic = topic

    def message(self, **fields: object) -> Any:
        """Return a message of the topic's type with these fields."""
        return self._topic.type.message(**fields)

    def encode(self, message: object) -> Any:  # noqa: ARG002 # as every writer has it
        """Raise UsageError: there is no way from software onto a stream but a gateway."""
        raise UsageError(
            f"{self._topic.key} is mapped to hardware: a software callback cannot publish on it."
        )

    def send(self, encoded: Any, timeline: Timeline) -> None:
        """Do nothing: `encode` has raised."""

    def publish(self, message: object, timeline: Timeline) -> Generator[Awaitable, object, None]:
        """Return when the message has passed the stream, after waiting for room where a FIFO blocks.

        Subscribers get the message as it is now; what the callback does with it afterwards is its own affair.
        """
        size = sum(map(len, self._topic.type.encode(message, joined_at_once=True)))
        message = snapshot(message)
        yield from self._topic.publish(self, message, size, timeline, timeline.callback)
