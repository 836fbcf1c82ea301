"""One board as a process: from its arguments until a signal ends it."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from reconros_zenoh.board.control import ControlServer, claim_name
from reconros_zenoh.board.gateway_control import GatewayServer
from reconros_zenoh.board.status import status
from reconros_zenoh.clock.process import begin_process, real_time_priority
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.measure.trace_file import traced_to
from reconros_zenoh.project.hosting import HostedBoard
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.project.hosting import BoardOptions
    from reconros_zenoh.project.loader import Project
    from reconros_zenoh.project.mapping_file import ProjectMapping


def run_board(
    router: str,
    profile: Profile,
    project: Project,
    mapping: ProjectMapping,
    options: BoardOptions,
    on_ready: Callable[[], None],
    seconds: float | None = None,
) -> dict[str, Any]:
    """Return the board's last status after SIGINT, SIGTERM or that many seconds, with everything closed.

    `on_ready` is called once the board serves. Raise TransportError without a router, UsageError when the
    name is taken or the trace cannot be written.
    """
    environment, stop = begin_process()
    with ZenohTransport.open(router) as transport:
        claim_name(transport, options.name)
        hosted = HostedBoard(environment, transport, profile, project, mapping, options)
        control = ControlServer(hosted.board, hosted.executor)
        gateways = GatewayServer(hosted.board, project.types())
        try:
            with traced_to(options.trace, hosted.board):
                on_ready()
                if seconds is not None:
                    environment.call_later(round(seconds * 1e9), succeed_once, stop)
                # A model has times to keep; without one the board shows what this host does.
                with real_time_priority() if profile.model else nullcontext():
                    environment.run(until=stop)
            return status(hosted.board, hosted.executor)
        finally:
            gateways.close()
            control.close()
            hosted.close()
