"""Boards and clients in one process in virtual time."""

from __future__ import annotations

import copy
from contextlib import ExitStack
from functools import lru_cache
from itertools import count
from typing import TYPE_CHECKING, Self

from host_clients.camera import Camera
from host_clients.closed_loop import ClosedLoop
from host_clients.group import gather
from host_clients.robot import DrivingRobot
from host_clients.scope import Scope
from host_clients.suite import EXCHANGES, exchange
from host_clients.viewer import Viewer
from reconros_zenoh.clock.process import tune_memory
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import TransportError
from reconros_zenoh.measure.trace_file import traced_to
from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    import simpy
    from numpy.typing import NDArray

    from host_clients.camera import CameraOptions
    from host_clients.daemon import ClientOptions
    from host_clients.robot import RobotOptions
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.measure.record import RoundTrip
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import ProjectMapping
    from reconros_zenoh.ros.type_registry import TypeRegistry

_SEEDS_KEPT = 4  # 15 MB each
_exchange = lru_cache(maxsize=_SEEDS_KEPT * len(EXCHANGES))(exchange)


class Simulation:
    """Boards and clients in one event loop until all clients, cameras and robots are done, or for some time.

    The same boards and clients, added in the same order, give the same round trips on any machine.
    What does not change is held once, whatever their number: message types, the requests of clients with one
    name and seed, and the right answers to them. Those of the last few seeds are kept for later simulations.
    """

    def __init__(self, types: TypeRegistry) -> None:
        """`types` are those of the clients."""
        tune_memory()
        self.environment = VirtualEnvironment()
        self._sessions = count(1)
        self._types = types
        self._done: list[simpy.Event] = []
        self._closing = ExitStack()
        self.begin_network()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.close()

    def begin_network(self) -> None:
        """Have what is added from now on hear nothing of what was added before.

        A network of its own and not only a ROS domain, because subscriptions hear their topic in all domains
        (to count what comes from a foreign one): each message would be refused by every other board.
        """
        self._network = SimulatedNetwork(self.environment)

    def add_board(
        self, profile: Profile, project: Project, mapping: ProjectMapping, options: BoardOptions
    ) -> HostedBoard:
        """Return a board that serves from the beginning, and whose trace is written at the end.

        Raise UsageError when it cannot host the project, or the trace cannot be written.
        """
        transport = self.context().transport
        board = HostedBoard(self.environment, transport, profile, project, mapping, options)
        self._closing.callback(board.close)
        self._closing.enter_context(traced_to(options.trace, board.board))
        return board

    def add_client(self, options: ClientOptions, on_round_trip: Callable[[RoundTrip], None]) -> None:
        """Have a client make its round trips."""
        context = self.context(options.domain)
        start = self.environment.event()
        loop = ClosedLoop(
            self.environment,
            # Each client has endpoints of its own; requests and answers stay those of the one that is copied.
            copy.copy(_exchange(options.name, options.seed)),
            context.node(f"{options.name}_client"),
            self._types,
            requests=options.requests,
            limit_ns=round(options.limit_s * 1e9),
            start=start,
            on_round_trip=on_round_trip,
        )
        self._done.append(loop.done)
        self.environment.call_later(round(options.wait_s * 1e9), _check_answered, loop, options)
        assert loop.warm.callbacks is not None
        loop.warm.callbacks.append(
            lambda _: gather(
                context.transport, self.environment, start, options.group, options.name, options.members
            )
        )

    def add_camera(self, options: CameraOptions) -> Camera:
        """Return a camera."""
        context = self.context(options.domain)
        start = self.environment.event()
        camera = Camera(self.environment, context, self._types, options, start)
        gather(context.transport, self.environment, start, options.group, "camera", options.members)
        self._done.append(camera.done)
        return camera

    def add_robot(self, options: RobotOptions, on_trip: Callable[[RoundTrip], None]) -> DrivingRobot:
        """Return a robot of the driving example; `out` and `view` say nothing here."""
        context = self.context(options.domain)
        robot = DrivingRobot(self.environment, context, self._types, options, on_trip)
        self._done.append(robot.done)
        return robot

    def add_viewer(
        self,
        domain: int,
        on_picture_trip: Callable[[RoundTrip], None],
        on_control_trip: Callable[[RoundTrip], None],
        on_picture: Callable[[NDArray[np.uint8]], None] = lambda _: None,
        group: str | None = None,
    ) -> None:
        """Have the pictures and the control loop of the design example observed; see `Viewer` and `Scope`.

        It begins at once, and others of its `group` may wait for it.
        """
        context = self.context(domain)
        Viewer(self.environment, context, self._types, on_picture_trip, on_picture)
        Scope(self.environment, context, self._types, on_control_trip)
        gather(context.transport, self.environment, self.environment.event(), group, "viewer", 1)

    def context(self, domain: int = 0) -> Context:
        """Return a new session for nodes of one's own."""
        transport = self._network.transport(f"{next(self._sessions):x}")
        return Context(transport, domain, self.environment.clock_ns)

    def run(self, seconds: float | None = None) -> None:
        """Return after so many seconds, None: when all that was added is done.

        Raise TransportError when a client is never answered.
        """
        if seconds is None:
            self.environment.run(until=self.environment.all_of(self._done))
        else:
            self.environment.run(until=round(seconds * 1e9))


def check_hosting(profile: Profile, project: Project, mapping: ProjectMapping) -> None:
    """Raise UsageError or FileError when no board of this kind can host the project under this mapping."""
    with Simulation(project.types()) as simulation:
        simulation.add_board(profile, project, mapping, BoardOptions())


def _check_answered(loop: ClosedLoop, options: ClientOptions) -> None:
    if not loop.warm.triggered:
        raise TransportError(
            f"no board answered the {options.name} client in domain {options.domain} within "
            f"{options.wait_s:g} s of virtual time. Give it a board that serves its topics in its domain."
        )
