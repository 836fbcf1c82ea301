"""The round-trip experiment in virtual time: board and clients in one process."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from board_daemon.hosting import BoardOptions
from host_clients.daemon import ClientOptions
from reconros_zenoh.board.control import status
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.experiments.roundtrip import ANSWER_LIMIT_S, CLIENTS, BoardReport, application_folder
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.measure.record import RecordWriter
from reconros_zenoh.project.loader import load_project

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.experiments.roundtrip import Plan
    from reconros_zenoh.measure.record import RoundTrip


def run_virtual(plan: Plan, report: BoardReport, on_progress: Callable[[str, str], None]) -> None:
    """Record the round trips of each mapping; `on_progress(mapping, client)` is called after each of them."""
    for name in plan.mappings:
        _run_mapping(plan, name, report, on_progress)


def _run_mapping(
    plan: Plan, mapping: str, report: BoardReport, on_progress: Callable[[str, str], None]
) -> None:
    project = load_project(application_folder())
    with Simulation(project.types()) as simulation, ExitStack() as files:
        hosted = simulation.add_board(
            read_profile(plan.profile),
            project,
            project.mapping(str(plan.mappings[mapping])),
            BoardOptions(seed=plan.seed),
        )
        for client in CLIENTS:
            writer = files.enter_context(RecordWriter(plan.record_path(mapping, client)))

            def record(round_trip: RoundTrip, client: str = client, writer: RecordWriter = writer) -> None:
                writer.write(round_trip)
                on_progress(mapping, client)

            options = ClientOptions(
                client,
                "",
                plan.requests,
                limit_s=ANSWER_LIMIT_S,
                seed=plan.seed,
                group="roundtrip",
                members=len(CLIENTS),
            )
            simulation.add_client(options, record)
        simulation.run()
        report.statuses[mapping] = status(hosted.board, hosted.executor)
