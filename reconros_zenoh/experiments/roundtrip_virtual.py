"""The round-trip experiment in virtual time: board and clients in one process."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING

from host_clients.daemon import ClientOptions
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.status import status
from reconros_zenoh.experiments.roundtrip import ANSWER_LIMIT_S, CLIENTS, BoardReport, application
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.measure.record import RecordWriter
from reconros_zenoh.project.hosting import BoardOptions

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.experiments.roundtrip import Plan
    from reconros_zenoh.measure.record import RoundTrip
    from reconros_zenoh.project.hosting import HostedBoard


def run_virtual(plan: Plan, report: BoardReport, on_progress: Callable[[str, str], None]) -> None:
    """Record the round trips of each mapping; `on_progress(mapping, client)` is called after each of them."""
    profile = read_profile(plan.profile)
    for mapping, path in plan.mappings.items():
        with ExitStack() as files, Simulation(application().types()) as simulation:
            writers = {
                client: files.enter_context(RecordWriter(plan.record_path(mapping, client)))
                for client in CLIENTS
            }
            record = partial(_record, writers, partial(on_progress, mapping))
            hosted = add_board_and_clients(simulation, profile, path, plan.requests, plan.seed, record)
            try:
                simulation.run()
            finally:  # an interrupted one, too, has run until now
                report.statuses[mapping] = status(hosted.board, hosted.executor)


def run_clients(
    profile: Profile,
    mapping: Path,
    requests: int,
    seed: int,
    on_round_trip: Callable[[str, RoundTrip], None],
) -> None:
    """Let the five clients make their round trips with a board under a mapping file.

    `on_round_trip` gets the client's name with each.
    """
    with Simulation(application().types()) as simulation:
        add_board_and_clients(simulation, profile, mapping, requests, seed, on_round_trip)
        simulation.run()


def add_board_and_clients(
    simulation: Simulation,
    profile: Profile,
    mapping: Path,
    requests: int,
    seed: int,
    on_round_trip: Callable[[str, RoundTrip], None],
) -> HostedBoard:
    """Return the board of the experiment, with its five clients in the simulation; see `run_clients`."""
    project = application()
    hosted = simulation.add_board(profile, project, project.mapping(str(mapping)), BoardOptions(seed=seed))
    for client in CLIENTS:
        options = ClientOptions(
            client, requests, ANSWER_LIMIT_S, seed=seed, group="roundtrip", members=len(CLIENTS)
        )
        simulation.add_client(options, partial(on_round_trip, client))
    return hosted


def _record(
    writers: Mapping[str, RecordWriter], on_progress: Callable[[str], None], client: str, trip: RoundTrip
) -> None:
    writers[client].write(trip)
    on_progress(client)
