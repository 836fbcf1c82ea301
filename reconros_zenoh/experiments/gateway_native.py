"""What gateways are worth on this host: no model, real bytes, real processes.

One process is the publisher, one the software subscriber, and one the board with its hardware nodes. Times
are those of the monotonic clock, which all processes of a host share. Bodies are checked after everybody has
noted his time: on few cores the checks would be in each other's way.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict
from contextlib import ExitStack
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, get_args

from reconros_zenoh.errors import ExperimentError
from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.experiments.gateway import Cell, Times, Variant
from reconros_zenoh.experiments.gateway_processes import run_board, run_listener, run_publisher
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.processes import Processes, receive, send
from reconros_zenoh.experiments.provenance import host, provenance
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.transport.zenoh import ZenohRouter
from reconros_zenoh.transport.zenoh_session import has_shared_memory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from multiprocessing.connection import Connection

    from reconros_zenoh.experiments.gateway_processes import Receipt

_COPIES = [
    (
        "SMT: the publisher copies each message once; each subscription copies it out: one per hardware "
        "node, all in the board's process, and one in the software subscriber's."
    ),
    (
        "gateway: the publisher copies it once; the board copies it out once, and each hardware node gets a "
        "read-only view of that copy; the software subscriber copies it out."
    ),
]
_IN_SHARED_MEMORY = (
    "The publisher's copy is in shared memory: below 256 KiB Zenoh makes it, below 32 KiB the message goes "
    "through sockets."
)
_THROUGH_SOCKETS = (
    "Messages go through sockets, which copy them several times more for each receiving process: shared "
    "memory is not used, because there is none or too little of it may be locked (see `ulimit -l`)."
)

K = TypeVar("K")
_LIMIT_S = 20.0
_CLOSING_S = 3.0
_WARM_UP = 5
_SITTINGS = 2
_LOST_S = 2.0
_MOST_LOST = 0.1

Role: TypeAlias = "tuple[Callable[..., None], tuple[object, ...]]"
"""What a process runs, and its arguments after its connection."""


def copies() -> list[str]:
    """Return what is copied where, in sentences."""
    return [*_COPIES, _IN_SHARED_MEMORY if has_shared_memory() else _THROUGH_SOCKETS]


def measure_native(
    sizes: Iterable[int], counts: Sequence[int], repeat: int, on_cell: Callable[[], None]
) -> dict[str, Any]:
    """Return every cell with the medians of `repeat` messages; `on_cell` is called after each.

    Ctrl-C keeps the cells that are complete. Raise ExperimentError when a subscriber got
    something wrong or nothing.
    """
    cells: list[Cell] = []
    with until_interrupted() as interruption, ExitStack() as networks:
        routers = {variant: free_endpoint() for variant in get_args(Variant)}
        for endpoint in routers.values():
            networks.enter_context(ZenohRouter.open(endpoint))
        for size, count in product(sizes, counts):
            times = take_turns(partial(_begin_cell, routers, size, count), repeat)
            cells.append(Cell(Side.SOFTWARE, size, count, times["smt"], times["bridged"]))
            on_cell()
    return {
        "experiment": "gateway",
        "clock": "wall",
        "repeat": repeat,
        "profile": "native",
        "statistic": "median",
        "cells": [cell.as_json() for cell in cells],
        "anchors": [],
        "copies": copies(),
        "host": host(0),
        "interrupted": interruption.happened,
        **provenance(),
    }


def _begin_cell(
    routers: Mapping[Variant, str], size: int, count: int, processes: Processes
) -> Mapping[Variant, Setup]:
    return {
        variant: native_setup(processes, router, variant, size, count) for variant, router in routers.items()
    }


class Setup:
    """Processes that publish and receive when they are told to.

    A receiver says "ready" on its connection, sends a list of receipts when all of its subscribers have a
    message, and answers every command with what is wrong with the bodies, empty for nothing. The source
    publishes the message whose number it is sent.
    """

    def __init__(self, processes: Processes, receivers: Iterable[Role], source: Role) -> None:
        """Start the processes and wait until messages get through; they end with `processes`."""
        self._receivers = [processes.start(function, *arguments) for function, arguments in receivers]
        for receiver in self._receivers:
            receive(receiver, time.monotonic() + _LIMIT_S)
        function, arguments = source
        self._source = processes.start(function, *arguments)
        self._number = _warm_up(self._source, self._receivers)

    def measure(self) -> tuple[int, int] | None:
        """Publish one message; return how long it took to the last hardware node and to the software [ns].

        None when it did not reach everybody: like rmw_zenoh, publishers rather lose messages than wait.
        """
        self._number += 1
        try:
            times = _round(self._source, self._receivers, self._number, _LOST_S)
        except TimeoutError:
            return None
        to_software_ns = times.pop("software")
        return max(times.values()), to_software_ns


def native_setup(processes: Processes, router: str, variant: Variant, size: int, count: int) -> Setup:
    """Return the setup of a variant of a cell, in the network of its router."""
    return Setup(
        processes,
        [(run_board, (router, variant, count)), (run_listener, (router,))],
        (run_publisher, (router, size)),
    )


def take_turns(begin: Callable[[Processes], Mapping[K, Setup]], repeat: int) -> dict[K, Times]:
    """Return the medians of each setup; they take turns, so that what else this host does meets all.

    The processes are started anew several times: it depends on the order of joining whom Zenoh serves first.
    """
    samples: defaultdict[K, list[tuple[int, int]]] = defaultdict(list)
    sittings = min(_SITTINGS, repeat)
    for sitting in range(sittings):
        with Processes(_CLOSING_S) as processes:
            setups = begin(processes)
            for _ in range(repeat // sittings + (sitting < repeat % sittings)):
                for name, setup in setups.items():
                    times_ns = setup.measure()
                    if times_ns is not None:
                        samples[name].append(times_ns)
    for name in setups:
        if len(samples[name]) < (1 - _MOST_LOST) * repeat:
            raise ExperimentError(f"{name}: {repeat - len(samples[name])} of {repeat} messages were lost.")
    return {name: _medians(pairs, repeat) for name, pairs in samples.items()}


def _medians(pairs: Sequence[tuple[int, int]], repeat: int) -> Times:
    to_hardware_ns, to_software_ns = zip(*pairs, strict=True)
    return Times(
        statistics.median(to_hardware_ns) / 1e6, statistics.median(to_software_ns) / 1e6, repeat - len(pairs)
    )


def _warm_up(source: Connection, receivers: Sequence[Connection]) -> int:
    """Return the number of the last message, after several that reached everybody.

    The first ones may be lost: who has just joined is not heard of everywhere.
    """
    deadline = time.monotonic() + _LIMIT_S
    number = arrived = 0
    while arrived < _WARM_UP:
        number += 1
        try:
            _round(source, receivers, number, 1.0)
            arrived += 1
        except TimeoutError:
            if time.monotonic() > deadline:
                raise ExperimentError("no message reaches all subscribers.") from None
    return number


def _round(
    source: Connection, receivers: Sequence[Connection], number: int, limit_s: float
) -> dict[str, int]:
    """Return the transmission times [ns] by subscriber of a message, checked."""
    send(source, number)
    times: dict[str, int] = {}
    deadline = time.monotonic() + limit_s
    for receiver in receivers:
        got: list[Receipt] = []
        while not got or got[0][1] < number:  # those of a message that came late
            got = receive(receiver, deadline)
        if any(receipt[1] != number for receipt in got):
            raise ExperimentError(f"instead of message {number} came {got}.")
        times.update({name: transmission_ns for name, _, transmission_ns in got})
    for receiver in receivers:
        send(receiver, "check")
        problem = receive(receiver, time.monotonic() + _LIMIT_S)
        if problem:
            raise ExperimentError(problem)
    return times
