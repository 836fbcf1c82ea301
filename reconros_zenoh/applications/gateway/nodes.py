"""The nodes of Fig. 5: one publishes images of random data, the others copy them and check what they got.

The same kernels run on a software-mapped topic, a hardware-mapped one, and with a gateway between. An image
carries the time of its publication as its stamp, and publisher, number and CRC-32 as its frame id.
Source: Gateways, Section 4.
"""

from __future__ import annotations

import zlib
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.ros.image import image_fields
from reconros_zenoh.ros.stamp import set_stamp, stamp_ns

if TYPE_CHECKING:
    from collections.abc import Callable, Generator
    from typing import TypeAlias

    from numpy.typing import NDArray

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.sources import Source
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.project.application import Application
    from reconros_zenoh.ros.type_registry import TypeRegistry

    OnReceived: TypeAlias = Callable[[str, int, int], None]
    """Gets a subscriber's name, the number of an image that it has copied, and the transmission time [ns]."""

SUBSCRIBERS = 8


class ImagePublisher:
    """Publishes an image of random data whenever it is called."""

    def __init__(
        self,
        name: str,
        writer: MessageWriter,
        types: TypeRegistry,
        environment: VirtualEnvironment,
        body: NDArray[np.uint8],
    ) -> None:
        self._name = name
        self._writer = writer
        self._header = types.message("std_msgs/msg/Header").cls
        self._time = types.message("builtin_interfaces/msg/Time").cls
        self._environment = environment
        self._body = body
        self._crc = zlib.crc32(body.data)
        self._number = 0

    def software(self, _: object, context: SoftwareContext) -> None:
        """Publish the next image."""
        context.publish(self._writer, self._image(context.started_ns))

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Publish the next image."""
        yield from thread.mem_write(self._body, to=self._writer)
        yield from thread.publish(self._writer, self._image(self._environment.now))

    def _image(self, now_ns: int) -> Any:
        self._number += 1
        header = self._header(
            stamp=self._time(sec=0, nanosec=0), frame_id=f"{self._name} {self._number} {self._crc:08x}"
        )
        set_stamp(header.stamp, now_ns)
        return self._writer.message(header=header, **image_fields("mono8", self._body[np.newaxis]))


class ImageSubscriber:
    """Copies each image into its memory and checks its number and its CRC."""

    def __init__(self, environment: VirtualEnvironment, on_received: Callable[[int, int], None]) -> None:
        self._environment = environment
        self._on_received = on_received
        self._expected: dict[str, int] = {}

    def software(self, image: Any, context: SoftwareContext) -> None:
        """Note and check the image; the copy was made before."""
        self._check(image, context.started_ns, context.compute(zlib.crc32, image.data))

    def hardware(self, thread: HardwareThread) -> Generator[Awaitable, object, None]:
        """Copy the image, note and check it."""
        image = yield from thread.get_init_data()
        ram = yield from thread.mem_read(image.data)
        now_ns = self._environment.now
        self._check(image, now_ns, (yield from thread.compute(zlib.crc32, ram)))

    def _check(self, image: Any, now_ns: int, crc: int) -> None:
        publisher, written_number, wanted_crc = image.header.frame_id.split()
        number = int(written_number)
        expected = self._expected.get(publisher, number)  # of another board: its first may be long ago
        self._expected[publisher] = number + 1
        if number != expected or crc != int(wanted_crc, 16):
            raise ValueError(f"got image {number} with CRC {crc:08x}, not {expected} with {wanted_crc}")
        self._on_received(number, now_ns - stamp_ns(image.header.stamp))


def random_body(size: int) -> NDArray[np.uint8]:
    """Return `size` random bytes, the same ones each time; nobody can change them."""
    return np.frombuffer(np.random.default_rng(size).bytes(size), np.uint8)


def run_nodes(
    app: Application,
    body: NDArray[np.uint8] | None = None,
    trigger: Source | None = None,
    on_received: OnReceived = lambda *_: None,
) -> None:
    """Run each node that has a place; publishers publish `body` (100 kB) at each `trigger` (a second)."""
    environment, mapping = app.board.environment, app.mapping
    executor = Executor(app.board, mapping.software_workers, mapping.hardware_workers, app.bitstreams)
    for name, place in mapping.callbacks.items():
        if not (place.software or place.slots):
            continue
        callback: ImagePublisher | ImageSubscriber
        if name.startswith("publisher"):
            kind, source = CallbackKind.TMR, trigger or app.source(name, "tmr")
            callback = ImagePublisher(
                f"{app.board.name}.{name}",
                app.writer(name, "pub"),
                app.types,
                environment,
                random_body(100_000) if body is None else body,
            )
        else:
            kind, source = CallbackKind.SUB, app.source(name, "sub")
            callback = ImageSubscriber(environment, partial(on_received, name))
        if place.software:
            executor.add_sw_callback(name, kind, source, callback.software)
        if place.slots:
            executor.add_hw_callback(name, place.slots, kind, source, callback.hardware)
    app.spin(executor)
