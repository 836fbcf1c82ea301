"""One scenario over both clocks: the same events in the same order at the same times of the model."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import pytest
import simpy

from reconros_zenoh.clock.activity import PARK, Activity
from reconros_zenoh.clock.virtual import VirtualEnvironment, succeed_once
from reconros_zenoh.clock.wall import WallEnvironment

if TYPE_CHECKING:
    from collections.abc import Generator

US = 1_000
HOUR_NS = 3_600 * 10**9

Log = list[tuple[float, str]]


@pytest.fixture(params=[VirtualEnvironment, WallEnvironment])
def environment(request: pytest.FixtureRequest) -> VirtualEnvironment:
    made: VirtualEnvironment = request.param()
    return made


class Scenario:
    """Jobs that share one slot.

    A timer ticks twice and makes a long and a short job each time; 200 us later the long one is interrupted.
    An impatient watcher sees the jobs that are done, and an activity counts them.
    """

    def __init__(self, environment: VirtualEnvironment) -> None:
        self._log: Log = []
        self._environment = environment
        self._start_ns = environment.now
        self._slot = simpy.Resource(environment)
        self._done = simpy.Store(environment)
        self._counter = Activity(self._count())
        self._end = environment.event()
        environment.process(self._timer())
        environment.process(self._watch())

    def run(self) -> Log:
        """Return what happened until the end and when, in microseconds from the start."""
        log = self._environment.run(until=self._end)
        assert isinstance(log, list)
        return log

    def _note(self, what: str) -> None:
        self._log.append(((self._environment.now - self._start_ns) / US, what))

    def _timer(self) -> Generator[simpy.Event, object, None]:
        for number in (1, 2):
            yield self._environment.timeout(300 * US)
            self._note("tick")
            long = self._environment.process(self._job(f"long {number}", 400))
            self._environment.process(self._job(f"short {number}", 150))
            self._environment.call_later(200 * US, long.interrupt)

    def _job(self, name: str, length_us: int) -> Generator[simpy.Event, object, None]:
        with self._slot.request() as request:
            yield request
            self._note(f"{name} begins")
            try:
                yield self._environment.timeout(length_us * US)
                self._note(f"{name} ends")
            except simpy.Interrupt:
                self._note(f"{name} is interrupted")
        yield self._done.put(name)
        self._counter.resume()

    def _watch(self) -> Generator[simpy.Event, object, None]:
        while True:
            seen = self._done.get()
            yield seen | self._environment.timeout(330 * US)
            if seen.triggered:
                self._note(f"{seen.value} is seen")
            else:
                seen.cancel()
                self._note("nothing is seen")

    def _count(self) -> Generator[simpy.Event | None, object, None]:
        for number in (1, 2, 3, 4):
            yield PARK
            self._note(f"{number} done")
        yield self._environment.timeout(100 * US)
        self._note("the end")
        self._end.succeed(self._log.copy())


EXPECTED: Log = [
    (300, "tick"),
    (300, "long 1 begins"),
    (330, "nothing is seen"),
    (500, "long 1 is interrupted"),
    (500, "1 done"),
    (500, "short 1 begins"),
    (500, "long 1 is seen"),
    (600, "tick"),
    (650, "short 1 ends"),
    (650, "2 done"),
    (650, "long 2 begins"),
    (650, "short 1 is seen"),
    (800, "long 2 is interrupted"),
    (800, "3 done"),
    (800, "short 2 begins"),
    (800, "long 2 is seen"),
    (950, "short 2 ends"),
    (950, "4 done"),
    (950, "short 2 is seen"),
    (1050, "the end"),
]


def test_the_scenario_is_the_same_in_virtual_and_in_wall_time(environment: VirtualEnvironment) -> None:
    assert Scenario(environment).run() == EXPECTED


def test_the_scenario_is_the_same_when_the_wall_clock_is_late() -> None:
    environment = WallEnvironment()
    late_ns = environment.now + 2_000 * US  # the scenario should be over by then

    def hold() -> None:
        while time.monotonic_ns() < late_ns:
            pass

    environment.call_later(0, hold)
    assert Scenario(environment).run() == EXPECTED


def test_a_posted_call_comes_after_what_is_due_already_and_before_what_is_due_later(
    environment: VirtualEnvironment,
) -> None:
    end = environment.event()
    calls: list[str] = []

    def first() -> None:
        environment.post(calls.append, "posted first")
        environment.post(calls.append, "posted second")
        environment.post(succeed_once, end)
        environment.post(succeed_once, end)
        calls.append("first")

    environment.call_later(0, first)
    environment.call_later(0, calls.append, "due already")
    environment.call_later(HOUR_NS, calls.append, "due later")
    environment.run(until=end)
    assert calls == ["first", "due already", "posted first", "posted second"]


def test_a_call_posted_before_the_run_is_done_in_it(environment: VirtualEnvironment) -> None:
    end = environment.event()
    environment.post(end.succeed, "value")
    assert not end.triggered
    assert environment.run(until=end) == "value"


def test_the_next_run_goes_on_where_the_last_ended(environment: VirtualEnvironment) -> None:
    start_ns = environment.now
    times: list[int] = []

    def ticks() -> Generator[simpy.Event, object, None]:
        while True:
            yield environment.timeout(100 * US)
            times.append((environment.now - start_ns) // US)

    environment.process(ticks())
    environment.run(until=environment.timeout(250 * US))
    assert times[:2] == [100, 200]
    environment.run(until=environment.timeout(200 * US))
    assert times[:4] == [100, 200, 300, 400]


@pytest.mark.parametrize("handled", [False, True])
def test_a_run_to_an_event_that_fails_raises_its_error(
    environment: VirtualEnvironment, handled: bool
) -> None:
    end = environment.event()

    def handle() -> Generator[simpy.Event, object, None]:
        with pytest.raises(ValueError, match="reason"):
            yield end

    if handled:
        environment.process(handle())
    environment.call_later(US, end.fail, ValueError("reason"))
    with pytest.raises(ValueError, match="reason"):
        environment.run(until=end)


def test_an_error_in_a_process_ends_the_run(environment: VirtualEnvironment) -> None:
    def fail() -> Generator[simpy.Event, object, None]:
        yield environment.timeout(US)
        raise ValueError("reason")

    environment.process(fail())
    with pytest.raises(ValueError, match="reason"):
        environment.run(until=environment.event())
