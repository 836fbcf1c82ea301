"""Table II: slots, bitstreams and reconfiguration times (ReconROS Executor, Section V-B)."""

from __future__ import annotations

from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.board.bitstream_fit import BitstreamFit, left_out_errors
from reconros_zenoh.board.board import Board
from reconros_zenoh.clock.activity import Activity
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.roundtrip import application
from reconros_zenoh.project.ini import Option
from reconros_zenoh.project.regions import read_regions
from reconros_zenoh.project.resources import SlotResources, resources_by_slot, slot_resources
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence

    import simpy

    from reconros_zenoh.board.profile import Model, Profile
    from reconros_zenoh.board.slots import Slot
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.experiments.roundtrip import Clock

ZYCAP_MB_S = 382.0
PCAP_MB_S = 128.0
"""What the ports do nominally (ReconROS Executor, Section III-A, after the authors of ZyCAP)."""

_SETTLE_NS = 10_000_000


@dataclass(frozen=True, slots=True)
class Printed:
    """The size and the time of one row of Table II."""

    size_bytes: int
    t_rc_ms: float


TABLE_II = {
    0: Printed(2838976, 24.0),
    1: Printed(2838976, 24.0),
    2: Printed(5285728, 38.4),
    3: Printed(4883328, 36.9),
}
PAPER_OFFSET_MS = 6.8
PAPER_BANDWIDTH_MB_S = 160.0

WHAT_IF = {
    "zycap_nominal": f"S / {ZYCAP_MB_S:.0f} MB/s (bandwidth published); no offset, no copy (assumed)",
    "pcap": f"S / {PCAP_MB_S:.0f} MB/s (bandwidth published); no offset (assumed)",
    "zero_copy": f"S / {ZYCAP_MB_S:.0f} MB/s + t_offset of the profile: a driver that does not copy reaches "
    "the nominal bandwidth and keeps the offset (assumed)",
}
"""What each what-if column assumes."""


@dataclass(frozen=True, slots=True)
class Regression:
    """`t_rc = S / B + t_offset` by least squares; `bandwidth_mb_s` is None where larger is not slower."""

    t_offset_ms: float
    bandwidth_mb_s: float | None
    residuals_ms: tuple[float, ...]

    @classmethod
    def of(cls, sizes: Sequence[int], times_ms: Sequence[float]) -> Regression | None:
        """Return the regression over slots, None for fewer than two different sizes."""
        if len(set(sizes)) < 2:
            return None
        megabytes = np.array(sizes) / 1e6
        ms_per_mb, offset_ms = np.polyfit(megabytes, times_ms, 1)
        residuals_ms = np.array(times_ms) - (ms_per_mb * megabytes + offset_ms)
        bandwidth = 1e3 / float(ms_per_mb) if ms_per_mb > 0 else None
        return cls(float(offset_ms), bandwidth, tuple(residuals_ms.tolist()))


def measure_reconfiguration(
    clock: Clock, profile: Profile, writes: int, regions: Sequence[str], on_slot: Callable[[], None]
) -> dict[str, Any]:
    """Return Table II with `writes` timed writes per slot, and estimates for other `regions`.

    `on_slot` is called after each slot; Ctrl-C keeps those that are complete. Raise UsageError for a profile
    that models nothing and for a text that is not the regions of a slot.
    """
    model = profile.model
    if model is None:
        raise UsageError(f"profile {profile.name!r} models no configuration port. Choose another --profile.")
    estimates = [_estimate(text, profile, model) for text in regions]
    project = application()
    environment = WallEnvironment() if clock == "wall" else VirtualEnvironment()
    network = SimulatedNetwork(environment)
    board = Board(environment, Context(network.transport("b0")), profile, project.slots)
    slots = {}
    with until_interrupted() as interruption, closing(board):
        resources_of = resources_by_slot(project.configuration.slots)
        for declared in project.configuration.slots:
            slot = board.slots[declared.id]
            written = environment.event()
            Activity(_write(board, slot, writes, written))
            times_ms = environment.run(until=written)
            slots[str(slot.slot_id)] = _row(
                slot, resources_of[declared.id], np.array(times_ms, dtype=np.float64), model
            )
            on_slot()
    return {
        "experiment": "reconfiguration",
        "clock": clock,
        "writes": writes,
        "profile": profile.name,
        "slots": slots,
        "regression": _dict(
            Regression.of(
                [row["size_bytes"] for row in slots.values()], [row["mean_ms"] for row in slots.values()]
            )
        ),
        "profile_model": {
            "t_offset_ms": model.icap.offset.ns / 1e6,
            "bandwidth_mb_s": model.icap.bandwidth.bytes_per_ns * 1e3,
            "basis_t_offset": model.icap.offset.basis,
            "basis_bandwidth": model.icap.bandwidth.basis,
        },
        "paper": _paper(),
        "what_if": WHAT_IF,
        "bitstream_fit": _fit_quality(model),
        "regions": estimates,
        "interrupted": interruption.happened,
    }


def _write(board: Board, slot: Slot, writes: int, done: simpy.Event) -> Generator[Awaitable, object, None]:
    """Write two bitstreams in turn; `done` happens with how long each write took [ms]."""
    # The loop may have to catch up with what came before.
    yield board.environment.timeout(_SETTLE_NS)
    pair = [Bitstream(slot.slot_id, name, slot.bitstream_size) for name in ("first", "second")]
    times_ms = []
    for index in range(writes):
        started_ns = board.environment.clock_ns()
        yield from board.zycap.write_bitstream(slot, pair[index % 2])
        times_ms.append((board.environment.clock_ns() - started_ns) / 1e6)
    done.succeed(times_ms)


def _row(
    slot: Slot, resources: SlotResources, times_ms: np.ndarray[Any, Any], model: Model
) -> dict[str, Any]:
    printed = TABLE_II[slot.slot_id]
    mean_ms = float(times_ms.mean())
    return {
        **asdict(resources),
        "size_bytes": slot.bitstream_size,
        "mean_ms": mean_ms,
        "min_ms": float(times_ms.min()),
        "max_ms": float(times_ms.max()),
        "paper_size_bytes": printed.size_bytes,
        "paper_ms": printed.t_rc_ms,
        "deviation": mean_ms / printed.t_rc_ms - 1,
        "what_if_ms": what_if_ms(slot.bitstream_size, model),
    }


def what_if_ms(size: int, model: Model) -> dict[str, float]:
    """Return t_rc [ms] of a bitstream of `size` bytes under each of WHAT_IF."""
    nominal_ms = size / ZYCAP_MB_S / 1e3
    return {
        "zycap_nominal": nominal_ms,
        "pcap": size / PCAP_MB_S / 1e3,
        "zero_copy": nominal_ms + model.icap.offset.ns / 1e6,
    }


def _paper() -> dict[str, Any]:
    """Return what Section V-B prints, and the regression of what Table II prints."""
    sizes = [row.size_bytes for row in TABLE_II.values()]
    times_ms = [row.t_rc_ms for row in TABLE_II.values()]
    predicted_ms = [size / PAPER_BANDWIDTH_MB_S / 1e3 + PAPER_OFFSET_MS for size in sizes]
    return {
        "t_offset_ms": PAPER_OFFSET_MS,
        "bandwidth_mb_s": PAPER_BANDWIDTH_MB_S,
        "residuals_ms": [
            time_ms - predicted for time_ms, predicted in zip(times_ms, predicted_ms, strict=True)
        ],
        "regression_of_table": _dict(Regression.of(sizes, times_ms)),
    }


def _fit_quality(model: Model) -> dict[str, Any]:
    """Return the fit of the bitstream size and its errors on the slots it rests on."""
    known = [(slot.frames, slot.size.bytes) for slot in model.bitstreams]
    fit = BitstreamFit.of(known)
    return {
        "constant_bytes": fit.constant,
        "bytes_per_frame": fit.bytes_per_frame,
        "points": len(known),
        "largest_error": max(abs(fit.size(count) / size - 1) for count, size in known),
        "left_out_errors": left_out_errors(known) if len(known) > 1 else [],
    }


def _estimate(text: str, profile: Profile, model: Model) -> dict[str, Any]:
    """Return what a slot with these regions would hold, and its size and times."""
    line = " ".join(text.split())
    try:
        resources = slot_resources(read_regions(Option(Path(), 1, "--region", line, (1,))))
    except FileError as error:
        raise UsageError(f"{error.problem} {error.remedy}") from None
    if not (resources.lut or resources.dsp or resources.bram36):
        raise UsageError(
            f"--region {line!r} holds no SLICE, DSP48 or RAMB36. Write for example "
            "`SLICE_X0Y150:SLICE_X103Y199, DSP48_X0Y60:DSP48_X7Y79`."
        )
    size = profile.bitstream_size(resources.lut, resources.dsp, resources.bram36)
    return {
        "region": line,
        **asdict(resources),
        "size_bytes": size,
        "known": any(
            (slot.lut, slot.dsp, slot.bram36) == (resources.lut, resources.dsp, resources.bram36)
            for slot in model.bitstreams
        ),
        "t_rc_ms": size / model.icap.bandwidth.bytes_per_ns / 1e6 + model.icap.offset.ns / 1e6,
        "what_if_ms": what_if_ms(size, model),
    }


def _dict(regression: Regression | None) -> dict[str, Any] | None:
    return asdict(regression) if regression else None
