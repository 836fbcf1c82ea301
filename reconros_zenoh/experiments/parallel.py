"""Many runs of the round-trip experiment in virtual time, on all cores of this computer."""

from __future__ import annotations

import os
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from reconros_zenoh.errors import ExperimentError
from reconros_zenoh.experiments.interruption import terminal_signals_blocked
from reconros_zenoh.experiments.roundtrip import CLIENTS
from reconros_zenoh.experiments.virtual import run_clients
from reconros_zenoh.measure.record import Record

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.measure.record import RoundTrip


class Run(NamedTuple):
    """The five clients against a board of this profile under this mapping file."""

    profile: Profile
    mapping: Path
    requests: int
    seed: int


class ParallelRuns:
    """Processes that make runs; what comes out does not depend on how many there are.

    They are started afresh rather than forked, because a process with a progress bar's thread cannot be
    forked safely.
    """

    def __enter__(self) -> Self:
        self._pool = ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), _end_with_parent)
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def records(self, runs: Iterable[Run]) -> Iterator[dict[str, Record]]:
        """Yield the record of each client, run by run in the given order.

        Raise ExperimentError if a process was ended from outside.
        """
        try:
            with terminal_signals_blocked():
                records = self._pool.map(records_of, runs)
            yield from records
        except BrokenProcessPool:
            raise ExperimentError(
                "a process of the simulation was ended from outside. Was there memory enough? Run it again."
            ) from None


def pooled(records: Sequence[Mapping[str, Record]]) -> dict[str, Record]:
    """Return one record per client with the round trips of all of these runs."""
    return {
        client: Record(
            client,
            np.concatenate([run[client].values_ms for run in records]),
            lost=sum(run[client].lost for run in records),
            wrong=sum(run[client].wrong for run in records),
        )
        for client in records[0]
    }


def _end_with_parent() -> None:
    """End with the process that gives the work, even when it is killed."""
    parent = parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def records_of(run: Run) -> dict[str, Record]:
    """Return the record of each client after one run, made here and now."""
    round_trips: dict[str, list[RoundTrip]] = {client: [] for client in CLIENTS}
    run_clients(*run, lambda client, round_trip: round_trips[client].append(round_trip))
    return {client: Record.of(client, made) for client, made in round_trips.items()}
