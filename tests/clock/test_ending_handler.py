"""When the signals that ask a command to end do end it."""

from __future__ import annotations

import pytest

from reconros_zenoh.clock import signals
from reconros_zenoh.clock.signals import EndingHandler


class MadeUpTime:
    """A clock that only the test moves on."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> MadeUpTime:
    clock = MadeUpTime()
    monkeypatch.setattr(signals, "time", clock)
    return clock


def test_a_signal_raises_and_further_ones_only_some_seconds_later(clock: MadeUpTime) -> None:
    handler = EndingHandler()
    with pytest.raises(KeyboardInterrupt):
        handler()
    clock.now_s += 4.9
    handler()
    clock.now_s += 0.2
    with pytest.raises(KeyboardInterrupt):
        handler()


def test_while_it_is_held_only_a_second_signal_some_seconds_later_raises(clock: MadeUpTime) -> None:
    handler = EndingHandler()
    handler.hold()
    handler()
    clock.now_s += 4.9
    handler()
    clock.now_s += 0.2
    with pytest.raises(KeyboardInterrupt):
        handler()


def test_what_came_while_it_was_held_raises_at_its_release_once() -> None:
    handler = EndingHandler()
    handler.hold()
    handler()
    with pytest.raises(KeyboardInterrupt):
        handler.release()
    handler.release()


def test_after_its_release_a_first_signal_raises() -> None:
    handler = EndingHandler()
    handler.hold()
    handler.release()
    with pytest.raises(KeyboardInterrupt):
        handler()


def test_one_that_has_raised_before_holds_nothing_back(clock: MadeUpTime) -> None:
    handler = EndingHandler()
    with pytest.raises(KeyboardInterrupt):
        handler()
    handler.hold()
    clock.now_s += 5.1
    with pytest.raises(KeyboardInterrupt):
        handler()
