"""A deployment in virtual time: what its services are, clones of it, and what came out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from reconros_zenoh.board.status import status
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.measure.record import Record, RecordWriter
from reconros_zenoh.measure.statistics import summarise
from reconros_zenoh.ros.type_registry import TypeRegistry

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from host_clients.camera import CameraOptions
    from host_clients.daemon import ClientOptions
    from host_clients.desktop import ViewerOptions
    from host_clients.robot import RobotOptions
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.measure.record import RoundTrip
    from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import ProjectMapping


@dataclass(frozen=True, slots=True)
class BoardPlan:
    """One board: its kind, what it hosts, and what distinguishes it."""

    profile: Profile
    project: Project
    mapping: ProjectMapping
    options: BoardOptions


@dataclass(frozen=True, slots=True)
class DeploymentPlan:
    """The boards, clients, cameras, viewers and robots of a deployment, by the names of their services."""

    boards: Mapping[str, BoardPlan]
    clients: Mapping[str, ClientOptions]
    cameras: Mapping[str, CameraOptions]
    viewers: Mapping[str, ViewerOptions]
    robots: Mapping[str, RobotOptions]

    def changed(self, requests: int | None, seed: int | None) -> DeploymentPlan:
        """Return the same with another number of requests or pictures and another seed, where given."""
        boards = {
            service: replace(
                board,
                options=replace(board.options, seed=board.options.seed if seed is None else seed),
            )
            for service, board in self.boards.items()
        }
        clients = {
            service: replace(
                client,
                seed=client.seed if seed is None else seed,
                requests=requests or client.requests,
            )
            for service, client in self.clients.items()
        }
        cameras = {
            service: replace(camera, pictures=requests or camera.pictures)
            for service, camera in self.cameras.items()
        }
        robots = {
            service: replace(robot, pictures=requests or robot.pictures)
            for service, robot in self.robots.items()
        }
        return DeploymentPlan(boards, clients, cameras, self.viewers, robots)

    def clone(self, number: int) -> DeploymentPlan:
        """Return the same with `-number` behind the names of the boards and of their traces.

        What is random on a board follows from its seed and its name, so it differs from clone to clone; the
        clients send the same inputs in the same order.
        """
        boards = {}
        for service, board in self.boards.items():
            name, trace = f"{board.options.name}-{number}", board.options.trace
            if trace is not None:
                trace = trace.with_stem(f"{trace.stem}-{number}")
            boards[service] = replace(board, options=replace(board.options, name=name, trace=trace))
        return replace(self, boards=boards)

    def place(self, domain: int) -> str:
        """Return the name of the board in this domain; of several, their names joined by `+`."""
        return "+".join(
            board.options.name for board in self.boards.values() if board.options.domain == domain
        )


class DeploymentRun:
    """Deployments that run beside each other, each on a network of its own.

    `round_trips` holds those of each client, by the names of board and service; those of a viewer are the
    pictures, and those of its control loop have the name of its service with `_control` behind it; those of a
    robot are from picture to command. `statuses` has the last status of each board by its name.
    """

    def __init__(self, plans: Sequence[DeploymentPlan]) -> None:
        self._plans = plans
        self.requests = sum(client.requests for plan in plans for client in plan.clients.values())
        self.requests += sum(camera.pictures for plan in plans for camera in plan.cameras.values())
        self.requests += sum(robot.pictures for plan in plans for robot in plan.robots.values())
        self.round_trips: dict[str, dict[str, list[RoundTrip]]] = {}
        self.simulated_ns = 0
        self.statuses: dict[str, dict[str, Any]] = {}
        self._may_lose: set[str] = set()

    def run(self, on_round_trip: Callable[[], None], seconds: float | None = None) -> None:
        """Return after so many seconds, None: when all that was added is done.

        Raise UsageError or TransportError when that cannot be.
        """
        with Simulation(TypeRegistry()) as simulation:
            hosted: list[HostedBoard] = []
            for plan in self._plans:
                simulation.begin_network()
                for service, board in plan.boards.items():
                    try:
                        hosted.append(
                            simulation.add_board(board.profile, board.project, board.mapping, board.options)
                        )
                    except UsageError as error:
                        raise UsageError(f"{service}: {error}") from error
                for service, client in plan.clients.items():
                    record = self._record(plan.place(client.domain), service, on_round_trip)
                    simulation.add_client(client, record)
                for service, robot in plan.robots.items():
                    record = self._record(plan.place(robot.domain), service, on_round_trip)
                    simulation.add_robot(robot, record)
                    self._may_lose.add(service)
                for service, viewer in plan.viewers.items():
                    pictures, indices = (
                        self.round_trips.setdefault(plan.place(viewer.domain), {}).setdefault(name, [])
                        for name in (service, f"{service}_control")
                    )
                    simulation.add_viewer(
                        viewer.domain,
                        pictures.append,
                        indices.append,
                        lambda _: on_round_trip(),
                        viewer.group,
                    )
                    self._may_lose.add(service)
                for camera in plan.cameras.values():
                    simulation.add_camera(camera)
            try:
                simulation.run(seconds)
            finally:
                self.simulated_ns = simulation.environment.now
                self.statuses = {each.board.name: status(each.board, each.executor) for each in hosted}

    def _record(
        self, place: str, service: str, on_round_trip: Callable[[], None]
    ) -> Callable[[RoundTrip], None]:
        trips = self.round_trips.setdefault(place, {}).setdefault(service, [])

        def record(round_trip: RoundTrip) -> None:
            trips.append(round_trip)
            on_round_trip()

        return record

    def all_right(self) -> bool:
        """Tell whether every answer came and was right; pictures, sent with best effort, may be lost."""
        return all(
            trip.outcome == "ok" or (trip.outcome == "lost" and service in self._may_lose)
            for services in self.round_trips.values()
            for service, trips in services.items()
            for trip in trips
        )

    def write_records(self, folder: Path) -> None:
        """Write one record per client, `folder/<board>/<service>.csv`."""
        for board, services in self.round_trips.items():
            for service, trips in services.items():
                with RecordWriter(folder / board / f"{service}.csv") as writer:
                    for trip in trips:
                        writer.write(trip)

    def summaries(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Return what `summarise` says of each client, by board and service."""
        return {
            board: {service: _summary(service, trips) for service, trips in services.items()}
            for board, services in self.round_trips.items()
        }

    def totals(self) -> dict[str, dict[str, Any]]:
        """Return the same of each client's round trips with all boards together, by service."""
        trips: dict[str, list[RoundTrip]] = {}
        for services in self.round_trips.values():
            for service, made in services.items():
                trips.setdefault(service, []).extend(made)
        return {service: _summary(service, made) for service, made in trips.items()}


def _summary(service: str, trips: Sequence[RoundTrip]) -> dict[str, Any]:
    record = Record.of(service, trips)
    return summarise(record.values_ms, record.lost, record.wrong)
