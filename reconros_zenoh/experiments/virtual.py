"""The round-trip experiment in virtual time: board and clients in one process."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from board_daemon.hosting import BoardOptions, HostedBoard
from host_clients.closed_loop import ClosedLoop
from host_clients.suite import exchange
from reconros_zenoh.board.control import status
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.experiments.roundtrip import CLIENTS, BoardReport, application_folder
from reconros_zenoh.measure.record import RecordWriter
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.memory import tune_malloc
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.experiments.roundtrip import Plan
    from reconros_zenoh.measure.record import RoundTrip

LIMIT_NS = 2_000_000_000


def run_virtual(plan: Plan, report: BoardReport, on_progress: Callable[[str, str], None]) -> None:
    """Record the round trips of each mapping; `on_progress(mapping, client)` is called after each of them."""
    tune_malloc()
    for name in plan.mappings:
        _run_mapping(plan, name, report, on_progress)


def _run_mapping(
    plan: Plan, mapping: str, report: BoardReport, on_progress: Callable[[str, str], None]
) -> None:
    environment = VirtualEnvironment()
    network = SimulatedNetwork(environment)
    project = load_project(application_folder())
    hosted = HostedBoard(
        environment,
        network.transport("b0"),
        read_profile(plan.profile),
        project,
        project.mapping(str(plan.mappings[mapping])),
        BoardOptions(seed=plan.seed),
    )
    start = environment.event()
    with ExitStack() as files:
        loops = []
        for number, client in enumerate(CLIENTS):
            writer = files.enter_context(RecordWriter(plan.record_path(mapping, client)))

            def record(round_trip: RoundTrip, client: str = client, writer: RecordWriter = writer) -> None:
                writer.write(round_trip)
                on_progress(mapping, client)

            context = Context(network.transport(f"c{number}"), 0, environment.clock_ns)
            loops.append(
                ClosedLoop(
                    environment,
                    exchange(client, plan.seed),
                    context.node(f"{client}_client"),
                    project.types(),
                    requests=plan.requests,
                    limit_ns=LIMIT_NS,
                    start=start,
                    on_round_trip=record,
                )
            )
        environment.run(until=environment.all_of([loop.warm for loop in loops]))
        start.succeed()
        environment.run(until=environment.all_of([loop.done for loop in loops]))
    report.statuses[mapping] = status(hosted.board, hosted.executor)
    hosted.close()
