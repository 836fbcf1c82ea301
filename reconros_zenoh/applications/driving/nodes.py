"""The nodes of Mapping and Optimizing Communication, Section 6, as callbacks.

None knows how its topics are mapped. The header of a picture, with its name as frame_id, goes with all that
is made of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.applications.driving.kernels import find_key_points, fit_lane, match_key_points, steer
from reconros_zenoh.applications.driving.view import HEIGHT, WIDTH
from reconros_zenoh.applications.roundtrip.callbacks.checks import check_image
from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.ros.image import image_fields

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from numpy.typing import NDArray

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.os_resources import Mailbox
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.writers import MessageWriter
    from reconros_zenoh.clock.activity import Awaitable
    from reconros_zenoh.ros.type_registry import TypeRegistry

    Picture = NDArray[np.uint8]
    Steps = Generator[Awaitable, object, None]
    Note = Callable[[str, str], None]
    """Hears that a station of the chain has the picture of this name."""

_WATCH = 1


def check_picture(message: Any) -> None:
    """Raise BadMessageError for a picture of another size or encoding than the camera's."""
    check_image(message, "bgr8", HEIGHT, WIDTH, 3)


def check_birds_view(message: Any) -> None:
    """Raise BadMessageError for what the lane planner does not publish."""
    check_image(message, "mono8", HEIGHT, WIDTH, 1)


def check_lane(message: Any) -> None:
    """Raise BadMessageError for a lane along which nobody can drive."""
    if not np.isfinite((message.offset, message.slope, message.curvature)).all():
        raise BadMessageError("lane", "the lane is not finite")


class Filter:
    """Publishes a picture for each that comes: Image Compensation, Gaussian Blur and Lane Planner."""

    def __init__(
        self, station: str, note: Note, kernel: Callable[[Picture], Picture], publisher: MessageWriter
    ) -> None:
        self._station = station
        self._note = note
        self._kernel = kernel
        self._publisher = publisher

    def hardware(self, thread: HardwareThread) -> Steps:
        """Publish what the kernel makes of the picture."""
        message = yield from thread.get_init_data()
        picture = yield from _read(thread, message)
        self._note(self._station, message.header.frame_id)
        result = yield from thread.compute(self._kernel, picture)
        yield from thread.mem_write(result, to=self._publisher)
        image = self._publisher.message(
            header=message.header, **image_fields("mono8" if result.ndim == 2 else "bgr8", result)
        )
        yield from thread.publish(self._publisher, image)


class Polyfit:
    """Publishes the lane that it sees in the bird's view."""

    def __init__(self, note: Note, publisher: MessageWriter) -> None:
        self._note = note
        self._publisher = publisher

    def hardware(self, thread: HardwareThread) -> Steps:
        """Publish the lane."""
        message = yield from thread.get_init_data()
        lines = yield from _read(thread, message)
        self._note("polyfit", message.header.frame_id)
        offset, slope, curvature, pixels = yield from thread.compute(fit_lane, lines)
        lane = self._publisher.message(
            header=message.header, offset=offset, slope=slope, curvature=curvature, pixels=pixels
        )
        yield from thread.publish(self._publisher, lane)


class LightDetection:
    """Publishes the header of a picture that tells of its light, then none until it has to watch again.

    Deviation: a callback has one source, so the node's subscription to the other detection is a callback of
    its own, in software, which tells this one with a word in a mailbox.
    """

    def __init__(self, tells: Callable[[Picture], bool], publisher: MessageWriter, watch: Mailbox) -> None:
        self._tells = tells
        self._publisher = publisher
        self._watch = watch

    def begin(self) -> None:
        """Watch from the first picture on."""
        self._watch.try_put(_WATCH)

    def hardware(self, thread: HardwareThread) -> Steps:
        """Publish the picture's header if it tells of the light and this node watches."""
        message = yield from thread.get_init_data()
        picture = yield from _read(thread, message)
        if (yield from thread.mbox_tryget(self._watch)) is None:
            return
        if (yield from thread.compute(self._tells, picture)):
            header = message.header
            yield from thread.publish(
                self._publisher, self._publisher.message(stamp=header.stamp, frame_id=header.frame_id)
            )
        else:
            yield from thread.mbox_tryput(self._watch, _WATCH)

    def watch(self, _: object, context: SoftwareContext) -> None:
        """Watch from the next picture on: the other light has been seen."""
        context.mbox_tryput(self._watch, _WATCH)


class LaneControl:
    """Publishes a command for each lane: to drive along it, or to stand, at a red light or without a lane."""

    def __init__(self, note: Note, publisher: MessageWriter, types: TypeRegistry) -> None:
        self._note = note
        self._publisher = publisher
        self._twist = types.message("geometry_msgs/msg/Twist").cls
        self._vector = types.message("geometry_msgs/msg/Vector3").cls
        self._halted = False

    def on_lane(self, lane: Any, context: SoftwareContext) -> None:
        """Publish the command."""
        self._note("lane_control", lane.header.frame_id)
        speed, turn = 0.0, 0.0
        if lane.pixels and not self._halted:
            speed, turn = steer(lane.offset, lane.slope, lane.curvature)
        twist = self._twist(
            linear=self._vector(x=speed, y=0.0, z=0.0), angular=self._vector(x=0.0, y=0.0, z=turn)
        )
        context.publish(self._publisher, self._publisher.message(header=lane.header, twist=twist))

    def on_red(self, _: object, __: SoftwareContext) -> None:
        """Stand still from now on."""
        self._halted = True

    def on_green(self, _: object, __: SoftwareContext) -> None:
        """Drive on."""
        self._halted = False


class OrbMap:
    """Publishes how many ORB key points a picture shares with the one before.

    Deviation: it stands for ORB-SLAM3, of which it has the first step, and draws no map.
    """

    def __init__(self, publisher: MessageWriter) -> None:
        self._publisher = publisher
        self._before: NDArray[np.uint8] = np.zeros((0, 32), np.uint8)

    def on_picture(self, message: Any, context: SoftwareContext) -> None:
        """Publish the number."""
        found = context.compute(find_key_points, message.data.reshape(HEIGHT, WIDTH, 3))
        matches = context.compute(match_key_points, self._before, found)
        self._before = found
        context.publish(self._publisher, self._publisher.message(data=matches))


def _read(thread: HardwareThread, message: Any) -> Generator[Awaitable, object, Picture]:
    """Return the picture of a message, colours last where it has some."""
    pixels = yield from thread.mem_read(message.data)
    return pixels.reshape((HEIGHT, WIDTH, 3) if message.encoding == "bgr8" else (HEIGHT, WIDTH))
