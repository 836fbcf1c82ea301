"""Signals while an event loop runs."""

from __future__ import annotations

import os
import signal
import time

import pytest
from watched_loop import LIMIT_S

from reconros_zenoh.clock.virtual import VirtualEnvironment


def test_a_signal_that_comes_in_a_finalizer_is_not_lost() -> None:
    class Interrupted:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)

    environment = VirtualEnvironment()
    done: list[str] = []
    environment.call_later(1, Interrupted)
    environment.call_later(1, done.append, "the same moment")
    with pytest.raises(KeyboardInterrupt):
        environment.run()
    assert (environment.now, done) == (1, [])
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_signal_in_the_last_event_is_not_lost() -> None:
    environment = VirtualEnvironment()
    last = environment.event()
    environment.call_later(1, last.succeed)
    assert last.callbacks is not None
    last.callbacks.append(lambda _: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        environment.run(until=last)
    environment.run()


def test_a_signal_ends_what_never_comes_back() -> None:
    ended: list[str] = []

    def never_comes_back() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        deadline_s = time.monotonic() + LIMIT_S
        while time.monotonic() < deadline_s:
            pass
        ended.append("by itself")  # an error would be lost behind the KeyboardInterrupt that comes then

    environment = VirtualEnvironment()
    environment.post(never_comes_back)
    with pytest.raises(KeyboardInterrupt):
        environment.run()
    assert not ended


def test_a_second_signal_interrupts_the_event_at_once() -> None:
    done: list[str] = []

    def goes_on() -> None:
        for place in ("after the first", "after the second"):
            os.kill(os.getpid(), signal.SIGINT)
            done.append(place)

    environment = VirtualEnvironment()
    environment.post(goes_on)
    with pytest.raises(KeyboardInterrupt):
        environment.run()
    assert done == ["after the first"]
