"""The executor on a board: what ReconROS_Executor_Init, _Add_HW_Callback, _Add_SW_Callback and _Spin do."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, SupportsIndex

from reconros_zenoh.board.additions import check_addition
from reconros_zenoh.board.bitstream import Bitstream, read_bitstreams
from reconros_zenoh.board.callback import HardwareImplementation
from reconros_zenoh.board.failures import Failures, text_of
from reconros_zenoh.board.hmt import HmtSource
from reconros_zenoh.board.host import Limit
from reconros_zenoh.board.software import SoftwareImplementation, is_plain
from reconros_zenoh.board.timing import describe, hardware_time, software_time
from reconros_zenoh.board.workers import HardwareWorker, SoftwareWorker
from reconros_zenoh.clock.duration import duration_ns
from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.executor.callbacks import CallbackEntry, CallbackKind
from reconros_zenoh.executor.reconros import ReconrosExecutor
from reconros_zenoh.executor.resource_mask import SOFTWARE, ResourceMask
from reconros_zenoh.executor.standard import StandardExecutor

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareCallback
    from reconros_zenoh.board.software import SoftwareCallback
    from reconros_zenoh.board.sources import Event, Source
    from reconros_zenoh.board.timing import ExecutionTime, Timing
    from reconros_zenoh.board.workers import Worker
    from reconros_zenoh.executor.callbacks import Dispatch

ExecutorKind = Literal["reconros", "standard"]


@dataclass(slots=True)
class _Registration:
    kind: CallbackKind
    source: Source
    check: Callable[[Any], None] | None
    software: SoftwareImplementation | None = None
    slots: dict[int, tuple[HardwareCallback, ExecutionTime, Limit | None]] = field(default_factory=dict)

    def timing(self) -> dict[str, object]:
        """Return what the time of the callback rests on in each place where it may run."""
        software = {} if self.software is None else {"software": describe(self.software.time)}
        return software | {f"slot {slot}": describe(time) for slot, (_, time, _) in self.slots.items()}


class Executor:
    """Runs callbacks on a board with m software and n hardware workers.

    Callbacks are added, then `spin` starts the workers (ReconROS Executor, Section IV, Listing 4). `kind`
    "standard" is the executor of ROS 2, which knows software workers only. Hardware workers serve the slots
    in the order of their ids. `bitstreams` is the folder of the partial bitstreams; without it they are held
    in memory only.
    """

    def __init__(
        self,
        board: Board,
        software_workers: int,
        hardware_workers: int,
        bitstreams: Path | None = None,
        kind: ExecutorKind = "reconros",
    ) -> None:
        for workers in (software_workers, hardware_workers):
            if not (isinstance(workers, SupportsIndex) and workers >= 0):
                raise UsageError(f"there cannot be {workers!r} workers. Give 0 or more.")
        if hardware_workers > len(board.slots):
            raise UsageError(
                f"hardware_workers = {hardware_workers} is more than the slots of the project: "
                f"{len(board.slots)}."
            )
        if kind == "standard" and hardware_workers:
            raise UsageError('the standard executor has no hardware workers; use executor = "reconros".')
        self.board = board
        self.kind = kind
        self._software_workers = software_workers
        self._slots = [board.slots[slot_id] for slot_id in sorted(board.slots)[:hardware_workers]]
        self._bitstreams = bitstreams
        self._policy = StandardExecutor() if kind == "standard" else ReconrosExecutor()
        self._registrations: dict[str, _Registration] = {}
        self._is_spinning = False
        self._workers: list[Worker] = []
        self._workers_of: dict[str, list[Worker]] = {}
        self.calls: Counter[str] = Counter()
        self.failures: Counter[str] = Counter()
        self._ways_to_fail: defaultdict[str, Failures] = defaultdict(Failures)

    def add_sw_callback(
        self,
        name: str,
        kind: CallbackKind,
        source: Source,
        function: SoftwareCallback,
        check: Callable[[Any], None] | None = None,
        timing: Timing | None = None,
        limit_ms: float | None = None,
    ) -> None:
        """Let the callback `name` run as a function; `check` raises BadMessageError for bad messages.

        A message whose check raises anything else is refused as well, with the reason `check_failed`.
        How long it takes says `timing`, or without it the table of the profile. A call that takes longer than
        `limit_ms` is failed and its worker goes on; what its function still does is not heard of.
        """
        if isinstance(source, HmtSource):
            raise UsageError(f"callback {name!r} reads a hardware-mapped topic: it cannot run in software.")
        self._check_addition(name, kind, source, function, check, timing)
        if not is_plain(function):
            raise UsageError(
                f"callback {name!r} has `yield` or `async`: in software it would never run. Give a plain "
                "function, or run it in hardware."
            )
        if not self._software_workers:
            raise UsageError(f"callback {name!r} runs in software, but there are no software workers.")
        time = software_time(self.board.profile, name, timing)
        self._register(name, kind, source, check).software = SoftwareImplementation(
            function, time, _limit(name, limit_ms)
        )

    def add_hw_callback(
        self,
        name: str,
        slots: Iterable[int],
        kind: CallbackKind,
        source: Source,
        thread: HardwareCallback,
        check: Callable[[Any], None] | None = None,
        timing: Timing | None = None,
        limit_ms: float | None = None,
    ) -> None:
        """Let the callback `name` run in these slots; the rest is as in `add_sw_callback`.

        One that is not reconfigurable holds it from the start, and no other callback can be added to it; none
        can be added to one with a gateway.
        """
        self._check_addition(name, kind, source, thread, check, timing)
        slots = list(slots) if isinstance(slots, Iterable) else []
        if not slots:
            raise UsageError(f"callback {name!r} has no slots to run in. Give their ids: [0].")
        served = {slot.slot_id: slot for slot in self._slots}
        for slot in slots:
            if slot not in served:
                raise UsageError(
                    f"callback {name!r} needs slot {slot!r}, which no hardware worker serves. They serve "
                    f"{', '.join(map(str, sorted(served))) or 'none'}."
                )
            served[slot].check(name)
        profile, limit = self.board.profile, _limit(name, limit_ms)
        times = {slot: hardware_time(profile, name, timing, served[slot].clock_hz) for slot in slots}
        # The last that may refuse: what is refused leaves nothing behind.
        registration = self._register(name, kind, source, check)
        for slot, time in times.items():
            served[slot].admit(name)
            registration.slots[slot] = (thread, time, limit)

    def spin(self) -> None:
        """Load the bitstreams, open every source and start the workers.

        Deviation: it returns at once, because the event loop belongs to the board and may host several.
        Raises UsageError the second time.
        """
        if self._is_spinning:
            raise UsageError("the executor spins already. Call spin() once, when all callbacks are added.")
        board = self.board
        wanted = {
            (slot, name): Bitstream(slot, name, board.slots[slot].bitstream_size)
            for name, registration in self._registrations.items()
            for slot in registration.slots
            if board.slots[slot].reconfigurable
        }
        board.zycap.init(read_bitstreams(self._bitstreams, wanted.values()) if self._bitstreams else wanted)
        self._is_spinning = True
        board.executors.append(self)
        for name, registration in self._registrations.items():
            slots = {
                slot: HardwareImplementation(self._bitstream(slot, name), *implementation)
                for slot, implementation in registration.slots.items()
            }
            entry = CallbackEntry(
                name,
                registration.kind,
                ResourceMask.of(software=registration.software, slots=slots),
                registration.source,
            )
            self._policy.add(entry)
        model = board.profile.model
        software_poll_ns = model.executor.software_poll.ns if model and self.kind == "reconros" else 0
        hardware_poll_ns = model.executor.hardware_poll.ns if model else 0
        self._workers += [SoftwareWorker(self, software_poll_ns) for _ in range(self._software_workers)]
        self._workers += [HardwareWorker(self, slot, hardware_poll_ns) for slot in self._slots]
        for entry in self._policy:
            self._workers_of[entry.name] = [
                worker for worker in self._workers if worker.resource in entry.mask
            ]
            registration = self._registrations[entry.name]
            check = registration.check and partial(_check_message, entry.name, registration.check)
            registration.source.open(
                partial(self._became_ready, entry), check, in_hardware=bool(registration.slots)
            )

    def close(self) -> None:
        """Begin no callback any more; those that run go on to their end."""
        self._policy.close()

    @property
    def awaits_spin(self) -> bool:
        """Whether it has callbacks, and `spin` has not been called."""
        return bool(self._registrations) and not self._is_spinning

    def select(self, worker: Worker) -> Dispatch | None:
        """Return the callback that this worker must run now, its message taken, or None."""
        dispatch = self._policy.select(worker, worker.resource)
        if dispatch is not None:
            self.calls[dispatch.entry.name] += 1
        return dispatch

    def complete(self, dispatch: Dispatch, event: Event, response: object) -> None:
        """Note that the callback has run to completion and pass on what it returned."""
        self._registrations[dispatch.entry.name].source.answer(event, response)
        self.board.spans.end(event.timeline)
        self._finish(dispatch)

    def fail(self, dispatch: Dispatch, event: Event, error: BaseException) -> None:
        """Note that the callback raised: it is counted, and the sender of a request is told.

        The first error of a type and place is logged with its traceback.
        """
        name = dispatch.entry.name
        self.failures[name] += 1
        if self._ways_to_fail[name].is_new(error):
            stages = event.timeline.stages_ns.items()
            spans = ", ".join(f"{stage} {ns / 1e6:g} ms" for stage, ns in stages if ns)
            self.board.log.error(
                "callback %s failed after %s; a failure of this kind is not reported again",
                name,
                spans or "0 ms",
                exc_info=error,
            )
        self._registrations[name].source.fail(event, f"callback {name} failed: {text_of(error)}")
        self._finish(dispatch)

    def statistics(self) -> dict[str, dict[str, object]]:
        """Return where each callback may run, how often it was called and failed, and what was dropped.

        `running` are its calls that have not ended: where, since when on the clock of the board, and what a
        call waits for that others have to provide, None for nothing.
        """
        return {
            name: {
                "kind": registration.kind.name,
                "software": registration.software is not None,
                "slots": sorted(registration.slots),
                "timing": registration.timing(),
                "calls": self.calls[name],
                "failed": self.failures[name],
                "dropped": registration.source.dropped,
                "running": [
                    {
                        "slot": None if worker.resource == SOFTWARE else worker.resource,
                        "since_ms": (worker.since_ns - self.board.started_ns) / 1e6,
                        "waits_for": worker.serves.waits_for or None,
                    }
                    for worker in self._workers
                    if worker.serves is not None and worker.serves.callback == name
                ],
            }
            for name, registration in self._registrations.items()
        }

    def _check_addition(
        self, name: str, kind: object, source: object, function: object, check: object, timing: object
    ) -> None:
        check_addition(name, kind, source, function, check, timing)
        if self._is_spinning:
            raise UsageError(
                f"callback {name!r} is added to an executor that spins already. Call spin() last."
            )

    def _register(
        self, name: str, kind: CallbackKind, source: Source, check: Callable[[Any], None] | None
    ) -> _Registration:
        for other, registration in self._registrations.items():
            if registration.source is source and other != name:
                raise UsageError(
                    f"callbacks {other!r} and {name!r} have one source, which makes one callback ready. Give "
                    "each its own."
                )
        registration = self._registrations.setdefault(name, _Registration(kind, source, check))
        if registration.source is not source:
            raise UsageError(f"callback {name!r} is registered already with another source.")
        if (registration.kind, registration.check) != (kind, check):
            raise UsageError(f"callback {name!r} is registered already with another kind or check.")
        return registration

    def _bitstream(self, slot_id: int, name: str) -> Bitstream:
        """Return what is in the slot when the callback can run there."""
        slot = self.board.slots[slot_id]
        if slot.reconfigurable:
            return self.board.zycap.bitstream(slot_id, name)
        assert slot.holds is not None  # it admitted the callback
        return slot.holds

    def _became_ready(self, entry: CallbackEntry) -> None:
        self._policy.refresh(entry)
        self._wake(entry)

    def _finish(self, dispatch: Dispatch) -> None:
        self._policy.finish(dispatch)
        self._wake(dispatch.entry)

    def _wake(self, entry: CallbackEntry) -> None:
        for worker in self._workers_of[entry.name]:
            worker.wake()


def _check_message(callback: str, check: Callable[[Any], None], message: object) -> None:
    """Refuse the message also where the check itself fails: that must harm neither sender nor board."""
    try:
        check(message)
    except BadMessageError:
        raise
    except (Exception, SystemExit) as error:
        raise BadMessageError(
            "check_failed",
            f"the check of callback {callback} failed: {type(error).__name__}: {text_of(error)}",
        ) from error


def _limit(callback: str, limit_ms: float | None) -> Limit | None:
    if limit_ms is None:
        return None
    return Limit(callback, duration_ns(f"limit_ms of callback {callback!r}", limit_ms, 1_000_000))
