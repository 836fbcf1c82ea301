"""The round-trip experiment in wall time: router, board and clients as processes of a deployment."""

from __future__ import annotations

import os
import threading
import uuid
from contextlib import suppress
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Self

from deploy.compose import read_compose
from deploy.runner import LocalRunner
from deploy.service_run import ServiceState
from reconros_zenoh.board.control import ask_status
from reconros_zenoh.errors import TransportError
from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.experiments.roundtrip import ANSWER_LIMIT_S, CLIENTS, BoardReport
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.experiments.roundtrip import Plan
    from reconros_zenoh.transport.base import Transport

BOARD = "board0"
_LOOK_EVERY_S = 0.2


def run_wall(plan: Plan, report: BoardReport, on_progress: Callable[[str, str], None]) -> None:
    """Record the round trips of each mapping; `on_progress(mapping, client)` is called after each of them.

    Raise ExperimentError, naming the process and with the end of its log, when one fails; nothing is left
    running.
    """
    with as_file(files("deploy") / "roundtrip.yaml") as compose:
        for mapping, path in plan.mappings.items():
            router = free_endpoint()
            environment = {
                **os.environ,
                "ROUTER": router,
                "LISTEN": router,
                "PROFILE": plan.profile,
                "MAPPING": str(path),
                "REQUESTS": str(plan.requests),
                "LIMIT": str(ANSWER_LIMIT_S),
                "SEED": str(plan.seed),
                "GROUP": uuid.uuid4().hex,
                "OUT": str((plan.folder / mapping).resolve()),
            }
            deployment = read_compose(compose, environment)
            with LocalRunner(deployment, plan.folder / mapping / "logs", environment) as runner:
                runner.wait_until_ready()
                # Not later: each process deals with a new session at once, whatever it should do just then.
                with (
                    ZenohTransport.open(router) as transport,
                    _Watch(plan, mapping, transport, on_progress),
                ):
                    try:
                        runner.run_until(set(CLIENTS))
                    finally:  # an interrupted one, too, has run until now
                        if runner.states["board"] is ServiceState.HEALTHY:
                            with suppress(TransportError):
                                report.statuses[mapping] = ask_status(transport, BOARD)


class _Watch:
    """Reports the lines that the clients of a mapping append to their records, from a thread of its own.

    With the first of them what the board says of its host begins anew: while all processes start, the host is
    busier than it will ever be.
    """

    def __init__(
        self, plan: Plan, mapping: str, transport: Transport, on_progress: Callable[[str, str], None]
    ) -> None:
        self._paths = {client: plan.record_path(mapping, client) for client in CLIENTS}
        self._seen = dict.fromkeys(CLIENTS, 0)
        self._mapping = mapping
        self._transport = transport
        self._on_progress = on_progress
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._look()

    def _run(self) -> None:
        while not any(self._seen.values()):
            if self._ended.wait(_LOOK_EVERY_S):
                return
            self._look()
        with suppress(TransportError):
            ask_status(self._transport, BOARD, host_anew=True)
        while not self._ended.wait(_LOOK_EVERY_S):
            self._look()

    def _look(self) -> None:
        for client, path in self._paths.items():
            # The first line is the header.
            lines = path.read_bytes().count(b"\n") - 1 if path.exists() else 0
            for _ in range(lines - self._seen[client]):
                self._on_progress(self._mapping, client)
            self._seen[client] = max(lines, 0)
