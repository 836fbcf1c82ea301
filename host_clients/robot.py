"""/robot: camera and wheels of the driving example, in a world of its own instead of Gazebo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from host_clients.image import image_message
from reconros_zenoh.applications.driving.world import Robot, World, is_red
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.errors import TransportError

if TYPE_CHECKING:
    from collections.abc import Generator

    import simpy

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context
    from reconros_zenoh.ros.types import TypeRegistry

RATE_HZ = 10.0
_SECOND_NS = 1_000_000_000
_WAIT_NS = 30 * _SECOND_NS
_ON_THE_WAY_NS = 2 * _SECOND_NS


class Step(NamedTuple):
    """Where the robot was when it took a picture [s, m], how fast it was [m/s], and what the light showed."""

    seconds: float
    x: float
    y: float
    off_lane: float
    speed: float
    red: bool


class DrivingRobot:
    """Publishes pictures on /image_raw and does what comes on /drive.

    It begins once somebody subscribes, and fails with TransportError when nobody does within 30 s. `done`
    happens 2 s after the last picture, when its command will have come. `loop_ns` says for each picture that
    was answered how long after it the command came; `unexpected` counts commands for no such picture.
    """

    def __init__(
        self, environment: VirtualEnvironment, context: Context, types: TypeRegistry, pictures: int
    ) -> None:
        self.steps: list[Step] = []
        self.loop_ns: dict[str, int] = {}
        self.unexpected = 0
        self._environment = environment
        self._types = types
        self._pictures = pictures
        self._robot = Robot()
        self._world = World()
        self._moved_ns = environment.now
        self._taken_ns: dict[str, int] = {}
        self._matched = environment.event()
        node = context.node("robot")
        self._publisher = node.publisher(
            types.message("sensor_msgs/msg/Image"), "/image_raw", on_matching=self._match
        )
        node.subscription(
            types.message("geometry_msgs/msg/TwistStamped"),
            "/drive",
            lambda received: environment.post(self._obey, received.message),
        )
        self.done = environment.process(self._run())

    def _run(self) -> Generator[simpy.Event, object, None]:
        yield self._matched | self._environment.timeout(_WAIT_NS)
        if not self._matched.triggered:
            raise TransportError("nobody subscribed to /image_raw. Start a board with the driving example.")
        started_ns = self._environment.now
        for number in range(self._pictures):
            self._take_picture(str(number), (self._environment.now - started_ns) / _SECOND_NS)
            yield self._environment.timeout(round(_SECOND_NS / RATE_HZ))
        yield self._environment.timeout(_ON_THE_WAY_NS)

    def _take_picture(self, number: str, seconds: float) -> None:
        self._move()
        robot = self._robot
        self.steps.append(Step(seconds, robot.x, robot.y, robot.off_lane, robot.speed, is_red(seconds)))
        message = image_message(self._types, "bgr8", self._world.picture(robot, seconds, int(number)))
        self._taken_ns[number] = now_ns = self._environment.now
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, _SECOND_NS)
        message.header.frame_id = number
        self._publisher.publish(message)

    def _obey(self, command: Any) -> None:
        taken_ns = self._taken_ns.pop(command.header.frame_id, None)
        if taken_ns is None:
            self.unexpected += 1
            return
        self.loop_ns[command.header.frame_id] = self._environment.now - taken_ns
        self._move()
        self._robot.speed, self._robot.turn = command.twist.linear.x, command.twist.angular.z

    def _move(self) -> None:
        """Let the robot go on as it was told until now."""
        now_ns = self._environment.now
        self._robot.move((now_ns - self._moved_ns) / _SECOND_NS)
        self._moved_ns = now_ns

    def _match(self, matching: bool) -> None:
        """Note, on any thread, whether somebody subscribes."""
        if matching:
            self._environment.post(succeed_once, self._matched)
