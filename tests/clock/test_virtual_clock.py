"""Virtual time jumps from event to event."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.clock.virtual import VirtualEnvironment, succeed_once

HOUR_NS = 3_600 * 10**9


def test_time_starts_where_it_is_told_and_jumps_to_the_next_event() -> None:
    environment = VirtualEnvironment(5)
    assert environment.now == environment.clock_ns() == 5
    times: list[int] = []
    environment.call_later(HOUR_NS, lambda: times.append(environment.now))
    environment.call_later(7, lambda: times.append(environment.now))
    environment.run()
    assert times == [12, 5 + HOUR_NS]
    assert environment.now == environment.clock_ns() == 5 + HOUR_NS


@given(st.lists(st.integers(0, 10**15) | st.integers(0, 3)))
def test_calls_happen_at_their_integer_times_and_those_of_one_time_in_the_order_made(
    delays: list[int],
) -> None:
    environment = VirtualEnvironment(3)
    calls: list[tuple[int, int]] = []

    def call(number: int) -> None:
        assert type(environment.now) is int
        calls.append((environment.now, number))

    for number, delay in enumerate(delays):
        environment.call_later(delay, call, number)
    environment.run()
    assert calls == sorted((3 + delay, number) for number, delay in enumerate(delays))


def test_a_call_gets_its_arguments() -> None:
    environment = VirtualEnvironment()
    calls: list[tuple[object, ...]] = []
    environment.call_later(1, lambda *arguments: calls.append(arguments), "later", 1)
    environment.post(lambda *arguments: calls.append(arguments), "posted", 2, None)
    environment.run()
    assert calls == [("posted", 2, None), ("later", 1)]


def test_a_posted_call_comes_now_but_after_what_is_due_already() -> None:
    environment = VirtualEnvironment()
    calls: list[tuple[int, str]] = []

    def note(name: str) -> None:
        calls.append((environment.now, name))

    def first() -> None:
        environment.post(note, "posted")
        note("first")

    environment.call_later(10, first)
    environment.call_later(10, note, "due already")
    environment.call_later(11, note, "later")
    environment.run()
    assert calls == [(10, "first"), (10, "due already"), (10, "posted"), (11, "later")]


def test_posting_waits_for_nothing_and_calls_nothing_itself() -> None:
    environment = VirtualEnvironment()
    calls: list[str] = []
    environment.post(calls.append, "posted")
    assert calls == []
    environment.step()
    assert calls == ["posted"]


def test_a_call_cannot_be_made_in_the_past() -> None:
    with pytest.raises(ValueError, match="Negative delay"):
        VirtualEnvironment().call_later(-1, print)


def test_an_error_in_a_call_ends_the_run_and_leaves_the_rest_to_the_next() -> None:
    environment = VirtualEnvironment()
    calls: list[str] = []
    environment.call_later(1, [].pop)
    environment.call_later(2, calls.append, "after")
    with pytest.raises(IndexError):
        environment.run()
    assert calls == []
    environment.run()
    assert calls == ["after"]


def test_succeed_once_lets_an_event_happen_and_then_does_nothing() -> None:
    environment = VirtualEnvironment()
    event = environment.event()
    happened: list[int] = []
    assert event.callbacks is not None
    event.callbacks.append(lambda _: happened.append(environment.now))
    environment.call_later(1, succeed_once, event)
    environment.call_later(1, succeed_once, event)
    environment.call_later(2, succeed_once, event)
    environment.run()
    assert happened == [1]
