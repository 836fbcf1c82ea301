"""The wall clock: the same event loop, never ahead of the monotonic clock.

Nothing here sleeps or measures how long something takes: times are compared for order only, and a wait ends
with what it waits for, or fails at a limit.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from threading import Event, Lock, Thread, current_thread, get_ident
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from watched_loop import LIMIT_S, join, start_loop, watch

from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    import simpy

MS = 10**6
HOUR_NS = 3_600_000 * MS

# A loop can sleep in two ways.
AHEAD = pytest.mark.parametrize(
    "prepare",
    [
        pytest.param(lambda _: None, id="no event ahead"),
        pytest.param(lambda environment: environment.timeout(HOUR_NS), id="event in an hour"),
    ],
)


def hold_until(due_ns: int) -> None:
    """Keep the loop from going on until a time has passed."""
    while time.monotonic_ns() <= due_ns:
        pass


def test_time_starts_at_the_monotonic_clock() -> None:
    before_ns = time.monotonic_ns()
    environment = WallEnvironment()
    assert before_ns <= environment.now <= environment.clock_ns() <= time.monotonic_ns()
    assert type(environment.now) is int


@settings(max_examples=30)
@given(st.lists(st.integers(0, 300_000), min_size=1, max_size=8))
def test_events_happen_in_the_order_of_their_times_and_none_before_its_time(delays: list[int]) -> None:
    environment = WallEnvironment()
    start_ns = environment.now
    calls: list[tuple[int, int]] = []

    def call(number: int) -> None:
        assert environment.now <= time.monotonic_ns()
        calls.append((environment.now - start_ns, number))

    for number, delay in enumerate(delays):
        environment.call_later(delay, call, number)
    environment.run(until=environment.timeout(max(delays)))
    assert calls == sorted((delay, number) for number, delay in enumerate(delays))


def test_an_event_for_which_the_loop_sleeps_does_not_happen_early() -> None:
    environment = WallEnvironment()
    due_ns = environment.now + 20 * MS
    environment.run(until=environment.timeout(20 * MS))
    assert environment.now == due_ns <= time.monotonic_ns()


def test_late_events_keep_their_times_and_their_order() -> None:
    environment = WallEnvironment()
    start_ns = environment.now
    ticks: list[int] = []

    def clock() -> Generator[simpy.Event, object, None]:
        for _ in range(6):
            yield environment.timeout(MS)
            ticks.append(environment.now - start_ns)

    end = environment.process(clock())
    environment.call_later(0, hold_until, start_ns + 4 * MS)
    environment.call_later(MS // 2, ticks.append, MS // 2)
    environment.run(until=end)
    assert ticks == [MS // 2, MS, 2 * MS, 3 * MS, 4 * MS, 5 * MS, 6 * MS]


def test_a_posted_call_has_the_time_of_the_post_and_comes_after_what_was_due_by_then() -> None:
    environment = WallEnvironment()
    start_ns = environment.now
    end = environment.event()
    calls: list[str] = []
    post_ns: list[int] = []

    def late() -> None:
        hold_until(start_ns + 2 * MS)
        post_ns.append(time.monotonic_ns())
        environment.post(posted)
        post_ns.append(time.monotonic_ns())

    def posted() -> None:
        calls.append("posted")
        assert post_ns[0] <= environment.now <= post_ns[1]
        end.succeed()

    environment.call_later(0, late)
    environment.call_later(2 * MS, calls.append, "due at 2 ms")
    environment.call_later(MS, calls.append, "due at 1 ms")
    environment.call_later(HOUR_NS, calls.append, "due in an hour")
    environment.run(until=end)
    assert calls == ["due at 1 ms", "due at 2 ms", "posted"]


def test_run_returns_the_value_of_the_event_it_ran_to() -> None:
    environment = WallEnvironment()
    end = environment.event()
    environment.call_later(MS, end.succeed, "value")
    assert environment.run(until=end) == "value"
    assert environment.run(until=end) == "value"  # has happened: returns at once


def test_a_loop_that_never_catches_up_ends_nevertheless() -> None:
    environment = WallEnvironment()

    def overload() -> Generator[simpy.Event, object, None]:
        while True:
            yield environment.timeout(1)  # a step takes longer than 1 ns

    environment.process(overload())
    join(start_loop(environment, environment.timeout(10)))


def test_calls_posted_before_a_run_wait_for_it_and_those_posted_after_it_for_the_next() -> None:
    environment = WallEnvironment()
    calls: list[str] = []
    environment.post(calls.append, "before")
    assert calls == []
    environment.run(until=environment.timeout(MS))
    assert calls == ["before"]
    environment.post(calls.append, "after")
    assert calls == ["before"]
    environment.run(until=environment.timeout(MS))
    assert calls == ["before", "after"]


def test_a_call_posted_by_the_loop_itself_comes_when_it_has_done_what_it_does() -> None:
    environment = WallEnvironment()
    end = environment.event()
    calls: list[str] = []

    def outer() -> None:
        environment.post(calls.append, "posted")
        environment.post(end.succeed)
        calls.append("outer")

    environment.post(outer)
    environment.run(until=end)
    assert calls == ["outer", "posted"]


@AHEAD
def test_a_call_posted_to_a_loop_that_sleeps_is_done_by_who_posts_it(
    prepare: Callable[[WallEnvironment], object],
) -> None:
    environment = WallEnvironment()
    prepare(environment)
    sleeps = watch(environment)
    end = environment.event()
    calls: list[tuple[object, ...]] = []
    loop = start_loop(environment, end)
    assert sleeps.wait(LIMIT_S)
    environment.post(lambda *arguments: calls.append((get_ident(), *arguments)), "a", 1)
    assert calls == [(get_ident(), "a", 1)]
    environment.post(end.succeed)
    join(loop)


@AHEAD
def test_an_event_that_a_posted_call_makes_wakes_a_loop_that_sleeps(
    prepare: Callable[[WallEnvironment], object],
) -> None:
    environment = WallEnvironment()
    prepare(environment)
    sleeps = watch(environment)
    end = environment.event()
    loop = start_loop(environment, end)
    assert sleeps.wait(LIMIT_S)
    environment.post(environment.call_later, 20 * MS, end.succeed)
    join(loop)


def test_who_posts_is_not_kept_for_longer_than_a_turn() -> None:
    environment = WallEnvironment()
    sleeps = watch(environment)
    end = environment.event()
    threads: list[int] = []

    def long() -> None:
        environment.call_later(0, hold_until, time.monotonic_ns() + 2 * MS)
        environment.call_later(0, lambda: threads.append(get_ident()))
        environment.call_later(0, end.succeed)

    loop = start_loop(environment, end)
    assert sleeps.wait(LIMIT_S)
    environment.post(long)
    join(loop)
    assert threads == [loop.ident]


def test_who_posts_is_not_kept_for_longer_than_a_turn_by_what_is_posted_meanwhile() -> None:
    environment = WallEnvironment()
    sleeps = watch(environment)
    end = environment.event()
    threads: list[int] = []

    def long() -> None:
        environment.post(lambda: threads.append(get_ident()))
        environment.post(end.succeed)
        hold_until(time.monotonic_ns() + 2 * MS)

    loop = start_loop(environment, end)
    assert sleeps.wait(LIMIT_S)
    environment.post(long)
    join(loop)
    assert threads == [loop.ident]


def test_what_a_posted_call_raises_ends_the_run_and_never_hits_who_posts_it() -> None:
    environment = WallEnvironment()
    sleeps = watch(environment)
    raised: list[BaseException] = []

    def run() -> None:
        try:
            environment.run(until=environment.event())
        except ZeroDivisionError as error:
            raised.append(error)

    loop = Thread(target=run, daemon=True)
    loop.start()
    assert sleeps.wait(LIMIT_S)
    environment.post(divmod, 1, 0)
    join(loop)
    assert len(raised) == 1


def test_calls_posted_from_many_threads_all_come_one_at_a_time_and_in_the_order_of_their_thread() -> None:
    environment = WallEnvironment()
    end = environment.event()
    calls: list[tuple[str, int]] = []
    turn = Lock()

    def call(name: str, number: int) -> None:
        assert turn.acquire(blocking=False)
        time.sleep(0)  # lets other threads have the interpreter
        calls.append((name, number))
        turn.release()
        if len(calls) == 4 * 100:
            end.succeed()

    def post_many() -> None:
        for number in range(100):
            environment.post(call, current_thread().name, number)

    loop = start_loop(environment, end)
    posters = [Thread(target=post_many, daemon=True) for _ in range(4)]
    for poster in posters:
        poster.start()
    for thread in (*posters, loop):
        join(thread)
    for poster in posters:
        assert [number for name, number in calls if name == poster.name] == list(range(100))


@AHEAD
@pytest.mark.timeout(LIMIT_S)
def test_a_signal_handler_may_post_to_a_loop_that_sleeps_in_the_main_thread(
    prepare: Callable[[WallEnvironment], object],
) -> None:
    environment = WallEnvironment()
    prepare(environment)
    sleeps = watch(environment)
    end = environment.event()
    ended = Event()

    def send_signals() -> None:
        assert sleeps.wait(LIMIT_S)
        # Again and again: CPython misses a signal that comes just before its main thread begins to wait.
        while not ended.wait(0.01):
            os.kill(os.getpid(), signal.SIGUSR1)

    before = signal.signal(signal.SIGUSR1, lambda *_: environment.post(succeed_once, end))
    sender = Thread(target=send_signals, daemon=True)
    sender.start()
    try:
        environment.run(until=end)
    finally:
        ended.set()
        join(sender)
        signal.signal(signal.SIGUSR1, before)


def test_a_punctual_process_leaves_one_core_to_a_computation() -> None:
    lines = ("from reconros_zenoh.clock.process import tune_process", "tune_process()", "import cv2")
    program = "; ".join((*lines, "print(cv2.getNumThreads())"))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "1\n"
