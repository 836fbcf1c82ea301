"""/robot: camera and wheels of the driving example, in a world of its own instead of Gazebo."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import dropwhile
from typing import TYPE_CHECKING, Any, NamedTuple

from host_clients.picture_source import PictureSource
from reconros_zenoh.applications.driving.world import Robot, World, is_red
from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.measure.record import RoundTrip

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence
    from pathlib import Path

    import numpy as np
    import simpy
    from numpy.typing import NDArray

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.type_registry import TypeRegistry

RATE_HZ = 10.0
_SECOND_NS = 1_000_000_000
_ON_THE_WAY_NS = 2 * _SECOND_NS
_PATIENCE_NS = _SECOND_NS // 2
_FASTEST = 10.0


@dataclass(frozen=True, slots=True)
class RobotOptions:
    """What a robot is told: where its record goes, and the port of its page, if there are any."""

    pictures: int
    out: Path | None = None
    view: int | None = None
    wait_s: float = 30.0
    domain: int = 0


class Step(NamedTuple):
    """Where the robot was when it took a picture [s, m], how fast it was [m/s], and what the light showed."""

    seconds: float
    x: float
    y: float
    off_lane: float
    speed: float
    red: bool


def most_off_lane_mm(steps: Sequence[Step]) -> float:
    """Return how far the robot was beside the middle of the lane at most."""
    return max(abs(step.off_lane) for step in steps) * 1e3


def stood_s(steps: Sequence[Step], *, red: bool) -> float:
    """Return how long the robot, once it had begun to drive, stood while the light was red, or was not."""
    under_way = dropwhile(lambda step: not step.speed, steps)
    return sum(not step.speed and step.red is red for step in under_way) / RATE_HZ


class DrivingRobot:
    """Publishes ten pictures a second on /image_raw, and does what comes on /drive.

    It stops when no command has come for half a second. It begins once somebody subscribes, and fails
    with TransportError when nobody does. `done` happens 2 s after the last picture. `on_trip` gets for
    each picture how long it took until its command was here; those without one are `lost` at the end, and
    what comes for them later is left aside. `unexpected` counts commands for no picture of this robot.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        context: Context,
        types: TypeRegistry,
        options: RobotOptions,
        on_trip: Callable[[RoundTrip], None],
        on_picture: Callable[[NDArray[np.uint8], float], None] = lambda *_: None,
    ) -> None:
        """`on_picture` gets each picture, and the speed at which it was taken."""
        self.steps: list[Step] = []
        self.unexpected = 0
        self._environment = environment
        self._options = options
        self._on_trip = on_trip
        self._on_picture = on_picture
        self._robot = Robot()
        self._world = World()
        self._moved_ns = environment.now
        self._commanded_ns = environment.now
        self._taken: dict[str, tuple[int, int]] = {}
        self._node = context.node("robot")
        self._node.subscription(
            types.message("geometry_msgs/msg/TwistStamped"), "/drive", self._arrive, check=_check
        )
        self._source = PictureSource(environment, self._node, types)  # it may match at once
        self.done = environment.process(self._run())

    @property
    def unanswered(self) -> int:
        """How many pictures have no command yet."""
        return len(self._taken)

    def _run(self) -> Generator[simpy.Event, object, None]:
        options = self._options
        yield from self._source.until_matched(options.wait_s)
        for number in range(options.pictures):
            self._take_picture(number)
            yield self._environment.timeout(round(_SECOND_NS / RATE_HZ))
        yield self._environment.timeout(_ON_THE_WAY_NS)
        for number, _ in self._taken.values():
            self._on_trip(RoundTrip(number, None, "lost"))

    def _take_picture(self, number: int) -> None:
        self._move()
        if self._environment.now - self._commanded_ns > _PATIENCE_NS:
            self._robot.speed = self._robot.turn = 0.0
        robot, seconds = self._robot, number / RATE_HZ
        self.steps.append(Step(seconds, robot.x, robot.y, robot.off_lane, robot.speed, is_red(seconds)))
        picture = self._world.picture(robot, seconds, number)
        name = f"{self._node.context.transport.session_id}.{number}"  # other robots have other sessions
        self._taken[name] = number, self._source.publish(name, picture)
        self._on_picture(picture, robot.speed)

    def _arrive(self, received: Received) -> None:
        """Note, on any thread, that a command has come."""
        self._environment.post(self._obey, received.message, self._node.context.clock_ns())

    def _obey(self, command: Any, arrived_ns: int) -> None:
        if self.done.triggered:
            return
        taken = self._taken.pop(command.header.frame_id, None)
        if taken is None:
            self.unexpected += 1
            return
        number, taken_ns = taken
        self._move()
        self._commanded_ns = self._environment.now
        self._robot.speed, self._robot.turn = command.twist.linear.x, command.twist.angular.z
        self._on_trip(RoundTrip(number, arrived_ns - taken_ns, "ok"))

    def _move(self) -> None:
        """Let the robot go on as it was told until now."""
        now_ns = self._environment.now
        self._robot.move((now_ns - self._moved_ns) / _SECOND_NS)
        self._moved_ns = now_ns


def _check(command: Any) -> None:
    """Raise BadMessageError for what no robot can do."""
    for name, value in (("speed", command.twist.linear.x), ("turn", command.twist.angular.z)):
        if not abs(value) <= _FASTEST:
            raise BadMessageError(name, f"the {name} is {value}, beyond {_FASTEST:g} m/s and rad/s")
