"""Many runs of the round-trip experiment in virtual time, on all cores of this computer."""

from __future__ import annotations

import os
import threading
from collections import deque
from multiprocessing import parent_process
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from reconros_zenoh.errors import ReconrosError
from reconros_zenoh.experiments.processes import Processes, commands, receive, send
from reconros_zenoh.experiments.roundtrip import CLIENTS
from reconros_zenoh.experiments.roundtrip_virtual import run_clients
from reconros_zenoh.measure.record import Record

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from multiprocessing.connection import Connection
    from pathlib import Path

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.measure.record import RoundTrip


class Run(NamedTuple):
    """The five clients against a board of this profile under this mapping file."""

    profile: Profile
    mapping: Path
    requests: int
    seed: int


class ParallelRuns(Processes):
    """Processes that make runs; what comes out does not depend on how many there are."""

    def __init__(self) -> None:
        super().__init__(grace_s=0.0)  # there is nothing that they had to close
        self._idle: list[Connection] = []

    def records(self, runs: Iterable[Run]) -> Iterator[dict[str, Record]]:
        """Yield the record of each client, run by run in the given order.

        Raise what a run raises, and ExperimentError if a process was ended from outside.
        """
        left = deque(enumerate(runs))
        busy: dict[Connection, int] = {}
        made: dict[int, dict[str, Record]] = {}
        for number in range(len(left)):
            while number not in made:
                while left and len(busy) < (os.cpu_count() or 1):
                    process = self._idle.pop() if self._idle else self.start(_make_runs)
                    busy[process], run = left.popleft()
                    send(process, run)
                ready = wait(busy)
                for process in [each for each in busy if each in ready]:
                    answer = receive(process)
                    if isinstance(answer, ReconrosError):
                        raise answer
                    made[busy.pop(process)] = answer
                    self._idle.append(process)
            yield made.pop(number)


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


def _make_runs(connection: Connection) -> None:
    """Answer each run with its records, or with what is wrong with it."""
    _end_with_parent()
    for run in commands(connection):
        try:
            connection.send(records_of(run))
        except ReconrosError as error:
            connection.send(error)


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
