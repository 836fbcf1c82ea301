"""Table I: the five callbacks in isolation, in hardware and in software (ReconROS Executor, Section V-A)."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from host_clients.closed_loop import ClosedLoop
from host_clients.suite import exchange
from reconros_zenoh.board.host import ThreadedHost
from reconros_zenoh.board.kernel_results import computed
from reconros_zenoh.board.osif import Osif
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.errors import ExperimentError, UsageError
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.profile_file import varied
from reconros_zenoh.experiments.provenance import host
from reconros_zenoh.experiments.roundtrip import application
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
from reconros_zenoh.project.mapping_file import CallbackMapping, ProjectMapping
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Generator
    from concurrent.futures import Future

    from reconros_zenoh.board.cpu import Cpu
    from reconros_zenoh.board.host import Limit
    from reconros_zenoh.board.profile import Model, Profile
    from reconros_zenoh.board.stages import Stage
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.experiments.roundtrip import Clock
    from reconros_zenoh.measure.record import RoundTrip
    from reconros_zenoh.project.loader import Project

_LIMIT_NS = 10_000_000_000
_SEED = 0


@dataclass(frozen=True, slots=True)
class PrintedTimes:
    """One row of Table I."""

    hardware_ms: float
    software_ms: float
    speedup: float


TABLE_I = {
    "sobel": PrintedTimes(16.5, 42.0, 2.5),
    "sort": PrintedTimes(0.85, 41.0, 48.2),
    "mnist": PrintedTimes(11.9, 16.5, 1.4),
    "inverse": PrintedTimes(0.35, 1.5, 4.3),
    "hash": PrintedTimes(81.0, 94.0, 1.2),
}
"""In the order of the paper."""


@dataclass(frozen=True, slots=True)
class Isolated:
    """What a callback took with nothing else running: the mean stages of the model [ms per message].

    `elapsed_ms` (from start to completion on the monotonic clock) and `kernel_ms` (what this host computed)
    have one value per request; they are empty in virtual time.
    """

    stages_ms: dict[Stage, float]
    elapsed_ms: list[float]
    kernel_ms: list[float]
    overruns: int


def measure_callbacks(
    clock: Clock, profile: Profile, repeat: int, on_run: Callable[[], None]
) -> dict[str, Any]:
    """Return Table I as the board model has it, each callback run `repeat` times in each place.

    `on_run` is called after each of the ten runs; Ctrl-C keeps the callbacks that are complete. Raise
    UsageError for a profile that models nothing.
    """
    model = profile.model
    if model is None:
        raise UsageError(
            f"profile {profile.name!r} models no board that could be compared. Choose another --profile."
        )
    project = application()
    # A network that loses nothing: the table is not about waiting for it.
    quiet = varied(
        profile,
        {
            ("model", "dds", name): 0.0
            for name in ("nack_probability", "loss_probability", "loss_probability_busy")
        },
    )
    table = {}
    overruns = 0
    with until_interrupted() as interruption:
        for name in TABLE_I:
            runs: dict[Side, Isolated] = {}
            for side in Side:
                runs[side] = run_alone(clock, quiet, project, name, side, repeat)
                overruns += runs[side].overruns
                on_run()
            table[name] = _row(name, runs[Side.HARDWARE], runs[Side.SOFTWARE], model)
    return {
        "experiment": "callbacks",
        "clock": clock,
        "repeat": repeat,
        "profile": profile.name,
        "callbacks": table,
        "basis_memif": model.memif.bandwidth.basis,
        "basis_calls": model.osif.call.basis,
        "host": host(overruns),
        "interrupted": interruption.happened,
    }


def run_alone(
    clock: Clock, profile: Profile, project: Project, callback: str, side: Side, repeat: int
) -> Isolated:
    """Run one callback of the project on a board of its own, one request at a time.

    The first request, which also loads the bitstream, is not among the `repeat` that are timed on the host.
    Raise ExperimentError when an answer is wrong or missing.
    """
    environment = WallEnvironment() if clock == "wall" else VirtualEnvironment()
    network = SimulatedNetwork(environment)
    mapping = _alone(project, callback, side)
    hosted = HostedBoard(environment, network.transport("b0"), profile, project, mapping, BoardOptions())
    watch = _Watch()
    board = hosted.board
    if clock == "wall":
        board.host.close()
        board.host = _WatchedHost(watch, environment, threads=1)
        board.osif = _WatchedOsif(watch, board.cpu, profile.model.osif.call.ns if profile.model else 0)
    start = environment.event()

    def record(round_trip: RoundTrip) -> None:
        if round_trip.outcome != "ok":
            raise ExperimentError(f"an answer of callback {callback!r} in {side} was {round_trip.outcome}.")
        watch.end_request()

    loop = ClosedLoop(
        environment,
        exchange(callback, _SEED),
        Context(network.transport("c0"), 0, environment.clock_ns).node("client"),
        project.types(),
        requests=repeat,
        limit_ns=_LIMIT_NS,
        start=start,
        on_round_trip=record,
    )
    try:
        environment.run(until=loop.warm)
        watch.clear()
        start.succeed()
        environment.run(until=loop.done)
        stages_ms = dict(board.spans.mean_ms()[callback])
    finally:
        hosted.close()
    return Isolated(stages_ms, watch.elapsed_ms, watch.kernel_ms, board.host.overruns.count)


def _alone(project: Project, callback: str, side: Side) -> ProjectMapping:
    """Return a mapping under which this callback has a worker and no other callback has a place."""
    (slot, *_) = next(thread.slots for thread in project.configuration.threads if thread.name == callback)
    in_hardware = side is Side.HARDWARE
    return ProjectMapping(
        name=f"{callback} alone in {side}",
        executor="reconros",
        software_workers=0 if in_hardware else 1,
        hardware_workers=len(project.slots) if in_hardware else 0,
        callbacks={name: CallbackMapping() for name in project.callbacks}
        | {callback: CallbackMapping(software=not in_hardware, slots=(slot,) if in_hardware else ())},
    )


def _row(name: str, hardware: Isolated, software: Isolated, model: Model) -> dict[str, Any]:
    paper = TABLE_I[name]
    split = {
        "compute_ms": hardware.stages_ms["execution"],
        "memif_ms": hardware.stages_ms["memif"],
        "calls_ms": hardware.stages_ms["osif"],
    }
    hardware_ms = sum(split.values())
    software_ms = software.stages_ms["execution"]
    kernel_ms = _median(hardware.kernel_ms + software.kernel_ms)
    return {
        "hardware_ms": hardware_ms,
        "software_ms": software_ms,
        "speedup": software_ms / hardware_ms if hardware_ms else None,
        "hardware": split,
        "paper_hardware_ms": paper.hardware_ms,
        "paper_software_ms": paper.software_ms,
        "paper_speedup": paper.speedup,
        "hardware_deviation": hardware_ms / paper.hardware_ms - 1,
        "software_deviation": software_ms / paper.software_ms - 1,
        "basis_hardware": model.callbacks[name].compute.basis,
        "basis_software": model.callbacks[name].software.basis,
        "elapsed_hardware_ms": _median(hardware.elapsed_ms),
        "elapsed_software_ms": _median(software.elapsed_ms),
        "host_kernel_ms": kernel_ms,
        "host_affords_hardware": None if kernel_ms is None else kernel_ms <= split["compute_ms"],
        "host_affords_software": None if kernel_ms is None else kernel_ms <= software_ms,
    }


def _median(values_ms: list[float]) -> float | None:
    return statistics.median(values_ms) if values_ms else None


class _Watch:
    """Times of this host while a callback runs; nothing is noted in virtual time."""

    def __init__(self) -> None:
        self._noted_ns: list[int] = []
        self.elapsed_ms: list[float] = []
        self.kernel_ms: list[float] = []

    def note(self, time_ns: int) -> None:
        """Note a time between the start of the callback and its completion, both included."""
        self._noted_ns.append(time_ns)

    def end_request(self) -> None:
        """Take from the first time that was noted to the last as one request."""
        if self._noted_ns:
            self.elapsed_ms.append((self._noted_ns[-1] - self._noted_ns[0]) / 1e6)
            self._noted_ns.clear()

    def clear(self) -> None:
        """Forget what the first request took."""
        self._noted_ns.clear()
        self.kernel_ms.clear()


class _WatchedHost(ThreadedHost):
    """Notes when computations start and when their results are used, and how long the kernels take."""

    def __init__(self, watch: _Watch, environment: VirtualEnvironment, threads: int) -> None:
        super().__init__(environment, threads)
        self._watch = watch
        self._started_ns = 0

    def start(
        self, task: object, function: Callable[..., Any], *arguments: object, limit: Limit | None = None
    ) -> Any:
        """Start a computation, see `Host.start`."""
        self._started_ns = time.monotonic_ns()
        return super().start(task, function, *arguments, limit=limit)

    def late_result(self, future: Future[Any] | Any) -> Generator[Awaitable, object, Any]:
        """Return the result of a callback's computation, see `Host.late_result`."""
        # Of what was sent before nobody asks for a late result; the last start was this one.
        self._watch.note(self._started_ns)
        result = yield from super().late_result(future)
        self._watch.note(time.monotonic_ns())
        return result

    def compute(self, kernel: Callable[..., Any], *arguments: object) -> Any:
        """Return `kernel(*arguments)`, see `Host.compute`; computed each time."""
        started_ns = time.perf_counter_ns()
        result = computed(kernel, *arguments)
        self._watch.kernel_ms.append((time.perf_counter_ns() - started_ns) / 1e6)
        return result


class _WatchedOsif(Osif):
    """Notes when a hardware thread calls: it starts with a call and ends with one."""

    def __init__(self, watch: _Watch, cpu: Cpu, call_ns: int) -> None:
        super().__init__(cpu, call_ns)
        self._watch = watch

    def call(self) -> Generator[Awaitable, object, None]:
        """Return when one call has been carried out, see `Osif.call`."""
        self._watch.note(time.monotonic_ns())
        yield from super().call()
        self._watch.note(time.monotonic_ns())
