"""What the processes of the gateway experiment on this host run: publisher, software subscriber, and board.

Each has a connection to the process that measures, and ends when nobody holds the other end any more.
"""

from __future__ import annotations

import threading
import time
import zlib
from dataclasses import replace
from functools import partial
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.applications.gateway.nodes import random_body
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.clock.process import tune_process
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.experiments.gateway import setup_mapping
from reconros_zenoh.experiments.processes import commands
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.project.hosting import BoardOptions, HostedBoard
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.mapping_file import CallbackMapping
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.image import image_message
from reconros_zenoh.ros.stamp import set_stamp, stamp_ns
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Generator
    from multiprocessing.connection import Connection

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.experiments.gateway import Variant
    from reconros_zenoh.project.application import Application
    from reconros_zenoh.project.mapping_file import ProjectMapping

_TOPIC = "/a"
_TYPE = "sensor_msgs/msg/Image"

Receipt = tuple[str, int, int]
"""A subscriber's name, the number of the message, and the transmission time [ns]."""


class Receiver:
    """Notes who got which message when, and checks the bodies when it is asked to."""

    def __init__(self, connection: Connection, readers: int) -> None:
        self._connection = connection
        self._readers = readers
        self._noted: list[tuple[str, Any, int]] = []
        self._images: list[Any] = []

    def note(self, name: str, image: Any) -> None:
        """Note that a subscriber has the message now; the others wait meanwhile, so hardly more than that."""
        self._noted.append((name, image, time.monotonic_ns()))
        if len(self._noted) >= self._readers:
            # Others may have lost the message before this one.
            last = image.header.frame_id
            self._noted = [noted for noted in self._noted if noted[1].header.frame_id == last]
        if len(self._noted) == self._readers:
            self._connection.send([_receipt(*noted) for noted in self._noted])
            self._images += [image for _, image, _ in self._noted]
            self._noted.clear()

    def check(self) -> None:
        """Answer with what is wrong with a body, or with nothing."""
        images, self._images = self._images, []
        wrong = sum(zlib.crc32(image.data) != int(image.header.frame_id.split()[1], 16) for image in images)
        self._connection.send(f"{wrong} of {len(images)} messages came with other bytes." if wrong else "")


def _receipt(name: str, image: Any, now_ns: int) -> Receipt:
    return name, int(image.header.frame_id.split()[0]), now_ns - stamp_ns(image.header.stamp)


def run_board(connection: Connection, router: str, variant: Variant, count: int) -> None:
    """Be the board with so many hardware nodes."""
    tune_process()
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
            _hardware_only(setup_mapping(Side.SOFTWARE, count)),
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


def _hardware_only(mapping: ProjectMapping) -> ProjectMapping:
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
    image = (yield from thread.get_init_data()).message
    yield from thread.mem_read(image.data)
    receiver.note(name, image)


def run_listener(connection: Connection, router: str) -> None:
    """Be the software subscriber."""
    tune_process()
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


def run_publisher(connection: Connection, router: str, size: int) -> None:
    """Publish an image of so many bytes whenever its number is sent."""
    tune_process()
    types = TypeRegistry()
    body = random_body(size)
    crc = zlib.crc32(body.data)
    image = image_message(types, "mono8", body[np.newaxis])
    with ZenohTransport.open(router) as transport:
        publisher = Context(transport).node("publisher").publisher(types.message(_TYPE), _TOPIC)
        for number in commands(connection):
            image.header.frame_id = f"{number} {crc:08x}"
            set_stamp(image.header.stamp, time.monotonic_ns())
            publisher.publish(image)
