"""The alarm that ends a sleep."""

from __future__ import annotations

from threading import Thread

from watched_loop import LIMIT_S, join

from reconros_zenoh.clock.alarm import Alarm


def test_it_is_silent_at_first_rings_for_who_waits_and_for_who_comes_later_and_then_no_more() -> None:
    alarm = Alarm()
    assert not alarm.wait(0)
    heard: list[bool] = []
    waiting = Thread(target=lambda: heard.append(alarm.wait(LIMIT_S)), daemon=True)
    waiting.start()
    alarm.ring()
    join(waiting)
    assert heard == [True]
    for _ in range(2):
        alarm.ring()
    assert [alarm.wait(0), alarm.wait(0)] == [True, False]


def test_a_wait_that_is_over_before_it_has_begun_ends() -> None:
    """The loop waits for as little as a microsecond; a SimpleQueue does so for ever after some thousands."""
    alarm = Alarm()
    waiting = Thread(target=lambda: [alarm.wait(0.000_002) for _ in range(30_000)], daemon=True)
    waiting.start()
    join(waiting)
