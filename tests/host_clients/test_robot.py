"""The robot of the driving example: what it does with commands, those that no board sends included."""

from __future__ import annotations

from typing import Any

import pytest

from host_clients.robot import DrivingRobot, RobotOptions, Step, most_off_lane_mm, stood_s
from reconros_zenoh.applications.driving.world import RADIUS
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.measure.record import RoundTrip
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.simulated import SimulatedNetwork

MS = 1_000_000


class Drive:
    """A robot that takes some pictures, and a driver that answers so much later what `command` returns."""

    def __init__(self, command: Any, pictures: int = 3, after_ns: int = 5 * MS) -> None:
        self.environment, types = VirtualEnvironment(), TypeRegistry()
        network = SimulatedNetwork(self.environment)
        self.here, there = (
            Context(network.transport(name), 0, self.environment.clock_ns) for name in ("a1", "b2")
        )
        self.trips: list[RoundTrip] = []
        self.robot = DrivingRobot(
            self.environment, self.here, types, RobotOptions(pictures), self.trips.append
        )
        twist, vector, header = (
            types.message(name).cls
            for name in ("geometry_msgs/msg/Twist", "geometry_msgs/msg/Vector3", "std_msgs/msg/Header")
        )
        driver = there.node("driver")
        publisher = driver.publisher(types.message("geometry_msgs/msg/TwistStamped"), "/drive")

        def answer(received: Any) -> None:
            picture = received.message.header
            found = command(picture.frame_id)
            if found is not None:
                number, speed, turn = found
                motion = twist(linear=vector(x=speed, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=turn))
                stamped = publisher.message_type.cls(
                    header=header(stamp=picture.stamp, frame_id=number), twist=motion
                )
                self.environment.call_later(after_ns, publisher.publish, stamped)

        driver.subscription(types.message("sensor_msgs/msg/Image"), "/image_raw", answer)
        self.environment.run(until=self.robot.done)


def test_it_drives_as_it_is_told_and_notes_how_long_it_took() -> None:
    drive = Drive(lambda name: (name, 0.5, 0.0))
    assert drive.trips == [RoundTrip(number, 5 * MS, "ok") for number in range(3)]
    assert [step.speed for step in drive.robot.steps] == [0.0, 0.5, 0.5]
    # Straight on, along the tangent, from 5 ms on.
    assert [step.y for step in drive.robot.steps] == pytest.approx([0, 0.0475, 0.0975])
    assert [step.x for step in drive.robot.steps] == pytest.approx([RADIUS] * 3)
    assert (drive.robot.unanswered, drive.robot.unexpected) == (0, 0)


def test_a_picture_without_a_command_is_lost() -> None:
    drive = Drive(lambda name: None if name == "a1.1" else (name, 0.0, 0.0))
    assert [(trip.index, trip.outcome) for trip in drive.trips] == [(0, "ok"), (2, "ok"), (1, "lost")]


def test_what_is_lost_at_the_end_is_not_answered_as_well() -> None:
    drive = Drive(lambda name: (name, 1.0, 0.0), after_ns=2150 * MS)
    assert [(trip.index, trip.outcome) for trip in drive.trips] == [(0, "ok"), (1, "ok"), (2, "lost")]
    drive.environment.run(until=3000 * MS)
    assert len(drive.trips) == 3
    assert (drive.robot.unanswered, drive.robot.unexpected) == (1, 0)


@pytest.mark.parametrize("number", ["a1.7", "", "0", "b2.0", "a1.0"])
def test_a_command_for_no_picture_is_not_obeyed(number: str) -> None:
    """Nor is a second one for the same picture."""
    drive = Drive(lambda _: (number, 1.0, 0.0))
    first = 1 if number == "a1.0" else 0
    assert drive.robot.unexpected == 3 - first
    assert [trip.outcome for trip in drive.trips].count("ok") == first


@pytest.mark.parametrize(
    ("speed", "turn", "reason"),
    [(float("nan"), 0.0, "speed"), (1e300, 0.0, "speed"), (0.0, float("-inf"), "turn")],
)
def test_what_no_robot_can_do_is_refused(speed: float, turn: float, reason: str) -> None:
    drive = Drive(lambda name: (name, speed, turn))
    assert drive.here.rejections.counts() == {reason: 3}
    assert [trip.outcome for trip in drive.trips] == ["lost"] * 3
    assert {(step.x, step.y) for step in drive.robot.steps} == {(RADIUS, 0)}


def test_it_stops_when_no_command_has_come_for_half_a_second() -> None:
    drive = Drive(lambda name: (name, 0.5, 0.0) if name in {"a1.0", "a1.1"} else None, pictures=10)
    # The last command came 5 ms behind the second picture, at 0.1 s.
    assert [step.speed for step in drive.robot.steps] == [0.0, *[0.5] * 6, 0.0, 0.0, 0.0]


def test_what_is_told_of_a_drive() -> None:
    steps = [
        Step(0.0, 0.0, 0.0, 0.0, 0.0, True),  # not yet begun
        Step(0.1, 0.0, 0.0, -0.02, 0.5, True),
        Step(0.2, 0.0, 0.0, 0.01, 0.0, True),
        Step(0.3, 0.0, 0.0, 0.0, 0.0, False),
        Step(0.4, 0.0, 0.0, 0.0, 0.0, False),
    ]
    assert most_off_lane_mm(steps) == 20
    assert (stood_s(steps, red=True), stood_s(steps, red=False)) == (0.1, 0.2)
