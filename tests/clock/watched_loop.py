"""A wall-clock event loop in a thread, and how to know that it sleeps."""

from __future__ import annotations

from threading import Event, Thread
from typing import TYPE_CHECKING

from reconros_zenoh.clock.alarm import Alarm

if TYPE_CHECKING:
    import simpy

    from reconros_zenoh.clock.wall import WallEnvironment

LIMIT_S = 30
"""Long after everything here is over; only a test that fails waits that long."""


class _WatchedAlarm(Alarm):
    """Says when the loop goes to sleep on it."""

    def __init__(self) -> None:
        super().__init__()
        self.sleeps = Event()

    def wait(self, timeout_s: float) -> bool:
        self.sleeps.set()
        return super().wait(timeout_s)


def watch(environment: WallEnvironment) -> Event:
    """Return what is set once the loop sleeps; then only what is due, or an alarm, wakes it."""
    alarm = environment._alarm = _WatchedAlarm()
    return alarm.sleeps


def start_loop(environment: WallEnvironment, until: simpy.Event) -> Thread:
    """Return the thread in which the loop runs until the event."""
    thread = Thread(target=environment.run, args=(until,), daemon=True)
    thread.start()
    return thread


def join(thread: Thread) -> None:
    """Return when the thread has ended; fail at the limit."""
    thread.join(LIMIT_S)
    assert not thread.is_alive()
