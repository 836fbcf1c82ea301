"""An emulated board in virtual time within this process: for notebooks, tests and first steps."""

from __future__ import annotations

from contextlib import closing
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np

from reconros_zenoh.board.actions import ActionClientSource, ActionSource
from reconros_zenoh.board.board import Board, SlotPlan
from reconros_zenoh.board.clients import ClientSource
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import Profile, read_profile
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource, TimerSource
from reconros_zenoh.board.status import status
from reconros_zenoh.clock.duration import duration_ns
from reconros_zenoh.clock.virtual import VirtualEnvironment, succeed_once
from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.trace_plots import trace_figure
from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, parse, tokens_expression
from reconros_zenoh.ros.names import resolve, type_name_of
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from reconros_zenoh.board.writers import TopicWriter
    from reconros_zenoh.ros.qos import QosProfile

_SECOND_NS = 1_000_000_000
_SLOT = SlotPlan(0, 20800, 160, 60)  # RS #0 of ReconROS Executor, Table II


class VirtualDesktop:
    """A network in virtual time with a node on the desktop: what a virtual board and a project share.

    `types` knows the message types, `desktop` is a node that publishes to the board and hears from it. Not
    thread-safe; nothing happens but in `run` and `round_trips`.
    """

    board: Board
    executor: Executor

    def __init__(self, types: TypeRegistry) -> None:
        self.types = types
        self.environment = VirtualEnvironment()
        self._network = SimulatedNetwork(self.environment)
        self._sessions = count(1)
        self.desktop = self._context().node("desktop")

    @property
    def now_ms(self) -> float:
        """The present virtual time [ms]."""
        return self.environment.now / 1e6

    def run(self, seconds: float) -> None:
        """Let so many seconds of virtual time pass.

        Raises UsageError for less than a nanosecond, and for callbacks that nobody has started.
        """
        if self.executor.awaits_spin:
            raise UsageError(
                "the board has callbacks that never run. Call board.executor.spin() before this."
            )
        self.environment.run(until=self.environment.now + duration_ns("run", seconds, _SECOND_NS))

    def listen(self, topic: str, type_name: str) -> list[Any]:
        """Return a list to which each message that is published on the topic from now on is appended."""
        messages: list[Any] = []
        self.desktop.subscription(
            self.types.message(type_name), topic, lambda received: messages.append(received.message)
        )
        return messages

    def round_trips(
        self,
        requests: tuple[str, str],
        answers: tuple[str, str],
        messages: Iterable[dict[str, Any]],
        limit_s: float = 2.0,
    ) -> NDArray[np.float64]:
        """Return the time [ms] from each message to its answer; the next leaves when the answer is in.

        `requests` and `answers` are topic and type name; a message is given by its fields. An answer that
        does not come within `limit_s` is NaN. One that comes later is taken for that of the message that is
        under way then, for nothing tells them apart: the limit is to be longer than any answer takes. Raises
        UsageError when nobody on the board hears the requests, or nobody publishes answers.
        """
        limit_ns = duration_ns("limit_s", limit_s, _SECOND_NS)
        self._check_ends(EndpointKind.SUBSCRIPTION, *requests)
        self._check_ends(EndpointKind.PUBLISHER, *answers)
        request_type = self.types.message(requests[1])
        answer_type = self.types.message(answers[1])
        arrived = self.environment.event()
        times_ms = []
        with (
            closing(self.desktop.publisher(request_type, requests[0])) as publisher,
            closing(self.desktop.subscription(answer_type, answers[0], lambda _: succeed_once(arrived))),
        ):
            for fields in messages:
                arrived = self.environment.event()
                sent_ns = self.environment.now
                limit = self.environment.timeout(limit_ns)
                publisher.publish(request_type.message(**fields))
                self.environment.run(until=arrived | limit)
                times_ms.append((self.environment.now - sent_ns) / 1e6 if arrived.triggered else np.nan)
        return np.array(times_ms)

    def status(self) -> dict[str, Any]:
        """Return what the board has done so far, as `reconros status` shows it."""
        return status(self.board, self.executor)

    def trace_figure(self) -> Figure:
        """Return a drawing of what ran where in the last second; see `measure.trace_plots`."""
        assert self.board.trace is not None
        return trace_figure(self.board.name, self.board.trace)

    def _check_ends(self, kind: EndpointKind, topic: str, type_name: str) -> None:
        """Raise UsageError unless there is such an end of the topic, with this type."""
        context = self.desktop.context
        name, wanted = resolve(topic, "/", "desktop"), self.types.message(type_name)
        hears = kind is EndpointKind.SUBSCRIPTION
        found = [
            token.dds_type
            for token in map(parse, context.transport.tokens(tokens_expression(context.domain), 0))
            if isinstance(token, EndpointToken)
            and (token.kind, token.name) == (kind, name)
            # Who listens on the desktop answers nothing.
            and not (hears and token.zid == context.transport.session_id)
        ]
        if wanted.dds_name in found:
            return
        what = "hears" if hears else "publishes on"
        if found:
            types = " and ".join(sorted({type_name_of(dds_type) for dds_type in found}))
            raise UsageError(f"who {what} {name} has the type {types}, not {wanted.name}. Use one type.")
        remedy = "a callback with a subscription to it" if hears else "a publisher on it"
        raise UsageError(
            f"nobody on the board {what} {name}. Give the board {remedy}, and call spin() before this."
        )

    def _context(self) -> Context:
        transport = self._network.transport(f"{next(self._sessions):x}")
        return Context(transport, clock_ns=self.environment.clock_ns)


class VirtualBoard(VirtualDesktop):
    """An emulated board without a project: endpoints by name, callbacks of this program.

    `profile` is the name of a kind of board or a file; the board has so many `slots`, each as large as RS #0
    of the paper. Callbacks are added to `executor`, then `executor.spin()` starts it, as in Listing 4 of
    ReconROS Executor, Section IV.
    """

    def __init__(
        self,
        profile: str | Path | Profile = "native",
        *,
        slots: int = 0,
        software_workers: int = 2,
        hardware_workers: int | None = None,
        seed: int = 0,
    ) -> None:
        if not (isinstance(slots, SupportsIndex) and slots >= 0):
            raise UsageError(f"a board cannot have {slots!r} slots. Give 0 or more.")
        super().__init__(TypeRegistry())
        self.board = Board(
            self.environment,
            self._context(),
            profile if isinstance(profile, Profile) else read_profile(profile),
            tuple(SlotPlan(slot, _SLOT.lut, _SLOT.dsp, _SLOT.bram36) for slot in range(slots)),
            seed=seed,
            traced=True,
        )
        self.executor = Executor(
            self.board, software_workers, slots if hardware_workers is None else hardware_workers
        )
        self._node = self.board.context.node(self.board.name)

    def subscription(self, topic: str, type_name: str, qos: QosProfile | None = None) -> SubscriptionSource:
        """Return a subscription of the board."""
        return SubscriptionSource(self.board, self._node, self.types.message(type_name), topic, qos)

    def publisher(self, topic: str, type_name: str, qos: QosProfile | None = None) -> TopicWriter:
        """Return a publisher of the board."""
        return self.board.writer(self._node, self.types.message(type_name), topic, qos)

    def timer(self, period_ms: float) -> TimerSource:
        """Return a timer of the board."""
        return TimerSource(self.board, duration_ns("the period of a timer", period_ms, 1_000_000))

    def service(self, name: str, type_name: str) -> ServiceSource:
        """Return a service server of the board."""
        return ServiceSource(self.board, self._node, self.types.service(type_name), name)

    def client(self, name: str, type_name: str) -> ClientSource:
        """Return a service client of the board."""
        return ClientSource(self.board, self._node, self.types.service(type_name), name)

    def action(self, name: str, type_name: str) -> ActionSource:
        """Return an action server of the board."""
        return ActionSource(self.board, self._node, self.types.action(type_name), name)

    def action_client(self, name: str, type_name: str) -> ActionClientSource:
        """Return an action client of the board."""
        return ActionClientSource(self.board, self._node, self.types.action(type_name), name)


class VirtualProject(VirtualDesktop):
    """A ReconROS project on an emulated board; its callbacks are served as soon as time passes.

    `profile` and `mapping` are names or files; without them they are those of `reconros run`.
    """

    def __init__(
        self,
        folder: str | Path,
        profile: str | Path | Profile | None = None,
        *,
        mapping: str | Path | None = None,
        seed: int = 0,
    ) -> None:
        project = load_project(Path(folder))
        super().__init__(project.types())
        self._hosted = HostedBoard(
            self.environment,
            self._context().transport,
            profile if isinstance(profile, Profile) else project.profile(profile),
            project,
            project.mapping(mapping),
            BoardOptions(seed=seed),
            traced=True,
        )
        self.board = self._hosted.board
        self.executor = self._hosted.executor
