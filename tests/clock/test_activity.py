"""Activities and signals: processes that go on at once, without an event in between."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from reconros_zenoh.clock.activity import PARK, Activity, Signal, limited
from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    from collections.abc import Generator

    import simpy

    from reconros_zenoh.clock.activity import Awaitable


def test_an_activity_begins_when_it_is_made_and_goes_on_when_it_is_resumed_both_without_an_event() -> None:
    log: list[str] = []

    def work() -> Generator[simpy.Event | None, object, None]:
        for name in "abc":
            log.append(name)
            yield PARK

    activity = Activity(work())
    assert log == ["a"]
    assert activity.parked
    activity.resume()
    assert log == ["a", "b"]


def test_an_activity_waits_for_an_event_and_gets_its_value() -> None:
    environment = VirtualEnvironment()
    log: list[object] = []

    def work() -> Generator[simpy.Event | None, object, None]:
        value = yield environment.timeout(5, "value")
        log.append((environment.now, value))

    activity = Activity(work())
    assert not activity.parked
    environment.run()
    assert log == [(5, "value")]


def test_an_event_that_has_happened_is_not_waited_for() -> None:
    environment = VirtualEnvironment()
    happened = environment.timeout(1, "value")
    environment.run()
    log: list[object] = []

    def work() -> Generator[simpy.Event | None, object, None]:
        log.append((yield happened))

    Activity(work())
    assert log == ["value"]


def test_resuming_an_activity_that_waits_for_an_event_or_has_ended_does_nothing() -> None:
    environment = VirtualEnvironment()
    log: list[int] = []

    def work() -> Generator[simpy.Event | None, object, None]:
        yield environment.timeout(5)
        log.append(environment.now)

    activity = Activity(work())
    activity.resume()
    assert log == []
    environment.run()
    activity.resume()
    environment.run()
    assert log == [5]


@pytest.mark.parametrize("late", [False, True])
def test_an_event_that_fails_raises_in_the_activity_which_may_go_on(late: bool) -> None:
    environment = VirtualEnvironment()
    event = environment.event()
    log: list[object] = []

    def work() -> Generator[simpy.Event | None, object, None]:
        if late:
            yield environment.timeout(2)
        try:
            yield event
        except ValueError as error:
            log.append(str(error))
        yield environment.timeout(10)
        log.append(environment.now)

    Activity(work())
    event.fail(ValueError("reason"))
    if late:
        event.defused = True  # nobody waits for it yet: SimPy would end the run
    environment.run()
    assert log == ["reason", 12 if late else 10]


def test_what_an_activity_raises_reaches_who_made_it_go_on() -> None:
    def work() -> Generator[simpy.Event | None, object, None]:
        yield PARK
        raise ValueError("reason")

    activity = Activity(work())
    with pytest.raises(ValueError, match="reason"):
        activity.resume()


def test_who_waits_for_a_signal_goes_on_while_it_is_fired_in_the_order_of_waiting() -> None:
    signal = Signal()
    log: list[object] = []

    def work(name: str) -> Generator[Awaitable, object, None]:
        log.append((name, (yield signal)))

    first, _ = Activity(work("first")), Activity(work("second"))
    first.resume()
    assert log == []
    signal.fire()
    assert log == [("first", None), ("second", None)]


def test_a_signal_happens_once_and_is_not_waited_for_any_more() -> None:
    signal = Signal()
    log: list[str] = []

    def work() -> Generator[Awaitable, object, None]:
        yield signal
        log.append("first")
        yield signal
        log.append("second")

    signal.fire()
    Activity(work())
    assert log == ["first", "second"]
    signal.fire()
    assert log == ["first", "second"]


def test_ten_thousand_events_that_have_happened_are_no_recursion() -> None:
    environment = VirtualEnvironment()
    happened = environment.timeout(0)
    environment.run()
    log: list[int] = []

    def work() -> Generator[simpy.Event | None, object, None]:
        for number in range(10_000):
            yield happened
            log.append(number)

    Activity(work())
    assert len(log) == 10_000


def failing(environment: VirtualEnvironment) -> Any:
    """An event that fails after 5 ns."""
    event = environment.event()
    environment.call_later(5, event.fail, KeyError("it"))
    return event


@pytest.mark.parametrize(
    ("wait", "limit_ns", "outcome"),
    [
        (lambda environment: environment.timeout(5, "value"), 10, (5, "value")),
        (lambda environment: environment.timeout(15, "value"), 10, (10, "stopped, although caught")),
        (failing, 10, (5, "'it'")),
        (lambda _: Signal(), 10, (10, "stopped, although caught")),
    ],
)
def test_steps_that_may_take_so_long(wait: Any, limit_ns: int, outcome: tuple[int, str]) -> None:
    environment = VirtualEnvironment()
    told: list[tuple[int, Any]] = []

    def steps() -> Any:
        try:
            return (yield wait(environment))
        except Exception as error:  # noqa: BLE001 - whatever it is
            return str(error)

    def run() -> Any:
        deadline = Signal()
        environment.call_later(limit_ns, deadline.fire)
        try:
            value = yield from limited(steps(), deadline, lambda: ValueError("stopped"))
        except ValueError as error:
            value = f"{error}, although caught"
        told.append((environment.now, value))

    Activity(run())
    environment.run(until=100)
    assert told == [outcome]


def test_stopped_steps_may_wait_once_more_before_they_end() -> None:
    environment = VirtualEnvironment()
    ended: list[int] = []

    def steps() -> Any:
        try:
            yield Signal()
        finally:
            yield environment.timeout(7)
            ended.append(environment.now)

    def run() -> Any:
        deadline = Signal()
        environment.call_later(10, deadline.fire)
        try:
            yield from limited(steps(), deadline, lambda: ValueError("stopped"))
        except ValueError:
            ended.append(environment.now)

    Activity(run())
    environment.run(until=100)
    assert ended == [17, 17]


@pytest.mark.parametrize("with_limit", [False, True])
@pytest.mark.parametrize("junk", [None, 5, "word"])
def test_what_cannot_be_waited_for_is_raised_where_it_was_yielded(junk: Any, with_limit: bool) -> None:
    said = []

    def work() -> Generator[Awaitable, object, None]:
        for _ in range(2):
            try:
                yield junk
            except TypeError as error:
                said.append(str(error))

    Activity(limited(work(), Signal(), ValueError) if with_limit else work())
    assert said == [f"{junk!r} cannot be waited for. Call what takes time with `yield from`."] * 2
