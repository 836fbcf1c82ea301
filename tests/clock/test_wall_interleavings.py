"""Another thread, or a signal handler, comes in between at every single instruction of the wall clock.

Threads that race find an unlucky moment once in a million runs. Here the moments are tried one after the
other: the interpreter's trace function stops a thread before its n-th instruction, and an intruder posts.
"""

from __future__ import annotations

import sys
from functools import partial
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest
from made_up_time import MS, MadeUpTime
from watched_loop import LIMIT_S, join, start_loop, watch

from reconros_zenoh.clock.alarm import Alarm
from reconros_zenoh.clock.wall import WallEnvironment

if TYPE_CHECKING:
    from collections.abc import Callable

    import simpy

    Post: TypeAlias = Callable[[WallEnvironment, simpy.Event], None]
    Way: TypeAlias = Callable[[Callable[[], None]], None]

WATCHED = {
    function.__code__
    for function in (
        WallEnvironment.run,
        WallEnvironment.post,
        WallEnvironment._catch_up,
        WallEnvironment._sleep,
    )
}


def in_another_thread(post: Callable[[], None]) -> None:
    thread = Thread(target=post)
    thread.start()
    thread.join()


def in_a_signal_handler(post: Callable[[], None]) -> None:
    post()


class Intruder:
    """Posts once: before the n-th instruction of the traced thread or when told, whichever comes first."""

    def __init__(self, moment: int, post: Callable[[], None]) -> None:
        self._instructions_left = moment
        self._post: Callable[[], None] | None = post
        self.came_in_between = False

    def trace(self, frame: Any, event: str, _: object) -> Any:
        if frame.f_code not in WATCHED:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            self._instructions_left -= 1
            if not self._instructions_left:
                self.came_in_between = self._post is not None
                self.post()
        return self.trace

    def post(self) -> None:
        if self._post is not None:
            post, self._post = self._post, None
            post()

    def run(self, function: Callable[..., object], *arguments: object) -> None:
        """Call the function in between whose instructions the intruder posts."""
        before = sys.gettrace()
        sys._getframe().f_trace_opcodes = True  # CPython 3.12 traces none unless asked before settrace
        sys.settrace(self.trace)
        try:
            function(*arguments)
        finally:
            sys.settrace(before)


class Sleep(Alarm):
    """The loop's sleep. The intruder ends it, or a time that is near; else it would be for good."""

    def __init__(self, made_up: MadeUpTime, intruder: Intruder) -> None:
        super().__init__()
        self._time = made_up
        self._intruder = intruder

    def wait(self, timeout_s: float) -> bool:
        if super().wait(0):
            return True
        self._intruder.post()
        if super().wait(0):
            return True
        assert timeout_s < 1, "the loop oversleeps"
        self._time.now_ns += round(timeout_s * 1e9)
        return False


def run_loop(made_up: MadeUpTime, moment: int, way: Way, post: Post, ahead_ns: int | None) -> bool:
    """Run a loop until the post has let its event happen; return False when it was over before the moment."""
    environment = WallEnvironment()
    end = environment.event()
    if ahead_ns is not None:
        environment.timeout(ahead_ns)
    intruder = Intruder(moment, partial(way, partial(post, environment, end)))
    environment._alarm = Sleep(made_up, intruder)
    try:
        intruder.run(environment.run, end)
    except ZeroDivisionError:
        assert not end.triggered
    else:
        assert end.processed
    return intruder.came_in_between


def a_call_that_ends_the_run(environment: WallEnvironment, end: simpy.Event) -> None:
    environment.post(end.succeed)


def a_call_that_makes_an_event(environment: WallEnvironment, end: simpy.Event) -> None:
    environment.post(environment.call_later, MS, end.succeed)


def a_call_that_raises(environment: WallEnvironment, _: simpy.Event) -> None:
    environment.post(divmod, 1, 0)


@pytest.mark.parametrize("way", [in_another_thread, in_a_signal_handler])
@pytest.mark.parametrize("post", [a_call_that_ends_the_run, a_call_that_makes_an_event, a_call_that_raises])
@pytest.mark.parametrize("ahead_ns", [None, 3_600_000 * MS], ids=["no event ahead", "event in an hour"])
def test_a_loop_never_sleeps_over_what_is_posted(
    made_up: MadeUpTime, way: Way, post: Post, ahead_ns: int | None
) -> None:
    moment = 1
    while run_loop(made_up, moment, way, post, ahead_ns):
        moment += 1
    assert moment > 50  # so many instructions at least were tried


@pytest.mark.parametrize("way", [in_another_thread, in_a_signal_handler])
@pytest.mark.parametrize("post", [a_call_that_ends_the_run, a_call_that_makes_an_event])
def test_a_call_posted_while_another_is_posted_wakes_a_loop_that_sleeps(way: Way, post: Post) -> None:
    moment = 1
    came_in_between = True
    while came_in_between:
        environment = WallEnvironment()
        sleeps = watch(environment)
        first, second = environment.event(), environment.event()
        loop = start_loop(environment, first & second)
        assert sleeps.wait(LIMIT_S)
        intruder = Intruder(moment, partial(way, partial(post, environment, second)))
        intruder.run(environment.post, first.succeed)
        intruder.post()
        join(loop)
        came_in_between = intruder.came_in_between
        moment += 1
    assert moment > 50
