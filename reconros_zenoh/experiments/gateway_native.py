"""What gateways are worth on this host: no model, real bytes, real processes.

One process is the publisher, one the software subscriber, and one the board with its hardware nodes. Times
are those of the monotonic clock, which all processes of a host share. Bodies are checked after everybody has
noted his time: on few cores the checks would be in each other's way.
"""

from __future__ import annotations

import multiprocessing
import signal
import statistics
import threading
import time
import zlib
from collections import defaultdict
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from importlib.resources import as_file, files
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, get_args

from board_daemon.hosting import BoardOptions, HostedBoard
from reconros_zenoh.applications.gateway.nodes import random_body
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment, keep_time
from reconros_zenoh.errors import ExperimentError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.experiments.gateway import Cell, Times, Variant, host, setup_mapping
from reconros_zenoh.experiments.interruption import until_interrupted
from reconros_zenoh.experiments.wall import free_port
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.mapping_file import CallbackMapping
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.types import TypeRegistry
from reconros_zenoh.transport.memory import tune_memory
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
    from multiprocessing.connection import Connection

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.project.application import Application
    from reconros_zenoh.project.mapping_file import Mapping as CallbackPlaces

COPIES = [
    (
        "SMT: the publisher copies each message once, into shared memory; each subscription copies it out: "
        "one per hardware node, all in the board's process, and one in the software subscriber's."
    ),
    (
        "gateway: the publisher copies it once; the board copies it out once, and each hardware node gets a "
        "read-only view of that copy; the software subscriber copies it out."
    ),
    "Below 256 KiB Zenoh itself makes the copy into shared memory; below 3 kB it goes through sockets.",
]

K = TypeVar("K")
_TOPIC = "/a"
_TYPE = "sensor_msgs/msg/Image"
_LIMIT_S = 20.0
_WARM_UP = 5
_SITTINGS = 2
_LOST_S = 2.0
_MOST_LOST = 0.1
_S = 1_000_000_000

Role: TypeAlias = "tuple[Callable[..., None], tuple[object, ...]]"
"""What a process runs, and its arguments after its connection."""

Receipt = tuple[str, int, int]
"""A subscriber's name, the number of the message, and the transmission time [ns]."""


def measure_native(
    sizes: Iterable[int], counts: Sequence[int], repeat: int, on_cell: Callable[[], None]
) -> dict[str, Any]:
    """Return every cell with the medians of `repeat` messages; `on_cell` is called after each.

    Ctrl-C keeps the cells that are complete.

    Raise ExperimentError when a subscriber got something wrong or nothing.
    """
    cells: list[Cell] = []
    with until_interrupted() as interruption, ExitStack() as networks:
        routers = {variant: f"tcp/127.0.0.1:{free_port()}" for variant in get_args(Variant)}
        for endpoint in routers.values():
            networks.enter_context(ZenohRouter.open(endpoint))
        for size, count in product(sizes, counts):
            times = take_turns(partial(_begin_cell, routers, size, count), repeat)
            cells.append(Cell("software", size, count, times["smt"], times["bridged"]))
            on_cell()
    return {
        "experiment": "gateway",
        "clock": "wall",
        "repeat": repeat,
        "profile": "native",
        "statistic": "median",
        "cells": [cell.as_json() for cell in cells],
        "anchors": [],
        "copies": COPIES,
        "host": host(0),
        "interrupted": interruption.happened,
    }


def _begin_cell(
    routers: Mapping[Variant, str], size: int, count: int, processes: ExitStack
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

    def __init__(self, processes: ExitStack, receivers: Iterable[Role], source: Role) -> None:
        """Start the processes and wait until messages get through; they end with the stack."""
        self._receivers = [processes.enter_context(_process(role)) for role in receivers]
        for receiver in self._receivers:
            _receive(receiver, time.monotonic() + _LIMIT_S)
        self._source = processes.enter_context(_process(source))
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


def native_setup(processes: ExitStack, router: str, variant: Variant, size: int, count: int) -> Setup:
    """Return the setup of a variant of a cell, in the network of its router."""
    return Setup(
        processes,
        [(_run_board, (router, variant, count)), (_run_listener, (router,))],
        (_run_publisher, (router, size)),
    )


def take_turns(begin: Callable[[ExitStack], Mapping[K, Setup]], repeat: int) -> dict[K, Times]:
    """Return the medians of each setup; they take turns, so that what else this host does meets all.

    The processes are started anew several times: it depends on the order of joining whom Zenoh serves first.
    """
    samples: defaultdict[K, list[tuple[int, int]]] = defaultdict(list)
    sittings = min(_SITTINGS, repeat)
    for sitting in range(sittings):
        with ExitStack() as processes:
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
    source.send(number)
    times: dict[str, int] = {}
    deadline = time.monotonic() + limit_s
    for receiver in receivers:
        got: list[Receipt] = []
        while not got or got[0][1] < number:  # those of a message that came late
            got = _receive(receiver, deadline)
        if any(receipt[1] != number for receipt in got):
            raise ExperimentError(f"instead of message {number} came {got}.")
        times.update({name: transmission_ns for name, _, transmission_ns in got})
    for receiver in receivers:
        receiver.send("check")
        problem = _receive(receiver, time.monotonic() + _LIMIT_S)
        if problem:
            raise ExperimentError(problem)
    return times


def _receive(connection: Connection, deadline: float) -> Any:
    if not connection.poll(max(0.0, deadline - time.monotonic())):
        raise TimeoutError
    try:
        return connection.recv()
    except EOFError:
        raise ExperimentError("a process of the experiment ended early; its reason stands above.") from None


@contextmanager
def _process(role: Role) -> Iterator[Connection]:
    """Run the role in a process of its own, which ends with the block."""
    function, arguments = role
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe()
    process = spawn.Process(target=_play, args=(function, there, *arguments), daemon=True)
    process.start()
    there.close()
    try:
        yield here
    finally:
        here.close()
        process.join(_LIMIT_S)
        if process.is_alive():
            process.terminate()


def _play(function: Callable[..., None], connection: Connection, *arguments: object) -> None:
    """Run what the process is for, until it ends or nobody hears it any more."""
    with suppress(BrokenPipeError):
        function(connection, *arguments)


class Receiver:
    """Notes who got which message when, and checks the bodies when it is asked to."""

    def __init__(self, connection: Connection, readers: int) -> None:
        self._connection = connection
        self._readers = readers
        self._receipts: list[Receipt] = []
        self._bodies: list[tuple[Any, int]] = []

    def note(self, name: str, image: Any) -> None:
        """Note that a subscriber has the message now."""
        now_ns = time.monotonic_ns()
        number, crc = image.header.frame_id.split()
        if self._receipts and self._receipts[0][1] != int(number):
            self._receipts.clear()  # of a message that others have lost
        sent_ns = image.header.stamp.sec * _S + image.header.stamp.nanosec
        self._receipts.append((name, int(number), now_ns - sent_ns))
        self._bodies.append((image.data, int(crc, 16)))
        if len(self._receipts) == self._readers:
            receipts, self._receipts = self._receipts, []
            self._connection.send(receipts)

    def check(self) -> None:
        """Answer with what is wrong with a body, or with nothing."""
        bodies, self._bodies = self._bodies, []
        wrong = [crc for body, crc in bodies if zlib.crc32(body) != crc]
        self._connection.send(
            f"{len(wrong)} of {len(bodies)} messages came with other bytes." if wrong else ""
        )


def _run_board(connection: Connection, router: str, variant: Variant, count: int) -> None:
    begin_process()
    environment = WallEnvironment()
    stop = environment.event()
    receiver = Receiver(connection, count)
    with as_file(files("reconros_zenoh.applications.gateway") / variant) as folder:
        project = load_project(folder)
    with ZenohTransport.open(router) as transport:
        hosted = HostedBoard(
            environment,
            transport,
            read_profile("native"),
            replace(project, main=partial(_run_hardware_nodes, receiver)),
            _hardware_only(setup_mapping("software", count)),
            BoardOptions(),
        )

        def obey() -> None:
            for _ in commands(connection):
                environment.post(receiver.check)
            environment.post(succeed_once, stop)

        threading.Thread(target=obey, daemon=True).start()
        connection.send("ready")
        try:
            environment.run(until=stop)
        finally:
            hosted.close()


def _hardware_only(mapping: CallbackPlaces) -> CallbackPlaces:
    """Return the mapping without its software nodes, which have processes of their own."""
    places = {name: place if place.slots else CallbackMapping() for name, place in mapping.callbacks.items()}
    return mapping.model_copy(update={"callbacks": places})


def _run_hardware_nodes(receiver: Receiver, app: Application) -> None:
    """Register the hardware nodes and spin."""
    executor = Executor(app.board, app.mapping.software_workers, app.mapping.hardware_workers)
    for name, place in app.mapping.callbacks.items():
        if place.slots:
            executor.add_hw_callback(
                name,
                place.slots,
                CallbackKind.SUB,
                app.source(name, "sub"),
                partial(_hardware_node, receiver, name),
            )
    app.spin(executor)


def _hardware_node(
    receiver: Receiver, name: str, thread: HardwareThread
) -> Generator[Awaitable, object, None]:
    image = yield from thread.get_init_data()
    yield from thread.mem_read(image.data)
    receiver.note(name, image)


def _run_listener(connection: Connection, router: str) -> None:
    begin_process()
    receiver = Receiver(connection, 1)
    with ZenohTransport.open(router) as transport:
        Context(transport).node("software").subscription(
            TypeRegistry().message(_TYPE),
            _TOPIC,
            lambda received: receiver.note("software", received.message),
        )
        connection.send("ready")
        for _ in commands(connection):
            receiver.check()


def _run_publisher(connection: Connection, router: str, size: int) -> None:
    begin_process()
    types = TypeRegistry()
    body = random_body(size)
    crc = zlib.crc32(body.data)
    image_type, header = types.message(_TYPE), types.message("std_msgs/msg/Header").cls
    stamp = types.message("builtin_interfaces/msg/Time").cls
    with ZenohTransport.open(router) as transport:
        publisher = Context(transport).node("publisher").publisher(image_type, _TOPIC)
        for number in commands(connection):
            seconds, nanoseconds = divmod(time.monotonic_ns(), _S)
            image = image_type.cls(
                header=header(stamp=stamp(sec=seconds, nanosec=nanoseconds), frame_id=f"{number} {crc:08x}"),
                height=1,
                width=size,
                encoding="mono8",
                is_bigendian=0,
                step=size,
                data=body,
            )
            publisher.publish(image)


def begin_process() -> None:
    """Make this process punctual, and leave Ctrl-C to the one that started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the experiment, and that its processes
    keep_time()
    tune_memory()


def commands(connection: Connection) -> Iterator[Any]:
    """Yield what is asked for until nobody asks any more."""
    while True:
        try:
            yield connection.recv()
        except (EOFError, OSError):
            return
