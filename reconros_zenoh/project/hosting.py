"""Putting a project on a board, in either clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from reconros_zenoh.board.board import Board
from reconros_zenoh.board.control import check_board_name
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.project.application import Application
from reconros_zenoh.rmw.node import Context

if TYPE_CHECKING:
    from pathlib import Path

    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import ProjectMapping
    from reconros_zenoh.transport.base import Transport


@dataclass(frozen=True, slots=True)
class BoardOptions:
    """What distinguishes one hosted board from another; UsageError for a name that cannot stand in a key.

    `trace` is the file for what the board did, which who runs the board writes.
    """

    name: str = "board0"
    domain: int = 0
    seed: int = 0
    bitstreams: Path | None = None
    tap: bool = False
    trace: Path | None = None

    def __post_init__(self) -> None:
        check_board_name(self.name)


class HostedBoard:
    """A board that runs a project; its callbacks are served as soon as the event loop runs."""

    def __init__(
        self,
        environment: VirtualEnvironment,
        transport: Transport,
        profile: Profile,
        project: Project,
        mapping: ProjectMapping,
        options: BoardOptions,
        *,
        traced: bool = False,
    ) -> None:
        threads = None
        context = Context(transport, options.domain, environment.clock_ns)
        if isinstance(environment, WallEnvironment):
            context = Context(transport, options.domain)
            threads = mapping.software_workers + len(project.slots)
        self.board = Board(
            environment,
            context,
            profile,
            project.slots,
            name=options.name,
            seed=options.seed,
            threads=threads,
            pointer_bytes=project.pointer_bytes,
            tap=options.tap,
            traced=traced or options.trace is not None,
        )
        self._application = Application(project, self.board, mapping, options.bitstreams)
        self.executor: Executor = project.start(self._application)

    def close(self) -> None:
        """Take the board's nodes out of the graph and let running computations end."""
        self._application.close()
        self.board.close()
