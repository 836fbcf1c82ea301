"""Serial queues: in order, one at a time, and what happens when too many wait."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.board.serial_queue import SerialQueue
from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    import pytest
    from small_board import Steps


class SlowQueue:
    """A queue that takes 100 ns for each item."""

    def __init__(self, depth: int) -> None:
        self.environment = VirtualEnvironment()
        self.log: list[tuple[int, str]] = []
        self.queue = SerialQueue(self._process, depth)

    def _process(self, item: str) -> Steps:
        self.log.append((self.environment.now, f"{item} begins"))
        yield self.environment.timeout(100)
        self.log.append((self.environment.now, f"{item} ends"))

    def put_at(self, time_ns: int, *items: str) -> None:
        for item in items:
            self.environment.call_later(time_ns, self.queue.put, item)


def test_one_after_the_other_in_order() -> None:
    slow = SlowQueue(depth=10)
    slow.put_at(30, "a")
    slow.put_at(50, "b", "c")
    slow.environment.run()
    assert slow.log == [
        (30, "a begins"),
        (130, "a ends"),
        (130, "b begins"),
        (230, "b ends"),
        (230, "c begins"),
        (330, "c ends"),
    ]


def test_after_a_pause_the_next_begins_at_once() -> None:
    slow = SlowQueue(depth=1)
    slow.put_at(0, "a")
    slow.put_at(1000, "b")
    slow.environment.run()
    assert slow.log[2:] == [(1000, "b begins"), (1100, "b ends")]


def test_when_too_many_wait_the_oldest_are_pushed_out_and_counted() -> None:
    slow = SlowQueue(depth=2)
    slow.put_at(0, "a")
    slow.put_at(10, "b", "c", "d", "e")  # a is in work, two may wait
    slow.environment.run()
    assert [text for _, text in slow.log if "begins" in text] == ["a begins", "d begins", "e begins"]
    assert slow.queue.dropped == 2


def test_several_put_at_once_before_it_begins() -> None:
    slow = SlowQueue(depth=3)
    slow.put_at(5, "a", "b", "c")
    slow.environment.run()
    assert len(slow.log) == 6
    assert slow.queue.dropped == 0


def test_an_item_whose_process_raises_is_counted_and_logged_once_and_the_next_comes(
    caplog: pytest.LogCaptureFixture,
) -> None:
    environment = VirtualEnvironment()
    done: list[str] = []

    def process(item: str) -> Steps:
        yield environment.timeout(100)
        if item == "bad":
            raise RuntimeError("no network")
        done.append(item)

    queue = SerialQueue(process, 3)
    for item in ("bad", "good", "bad"):
        queue.put(item)
    environment.call_later(1000, queue.put, "later")
    environment.run()
    assert done == ["good", "later"]
    assert queue.dropped == 2
    assert caplog.messages == [
        "a message was lost on its way through the board; a loss of this kind is not reported again"
    ]
    assert [str(record.exc_info[1]) for record in caplog.records if record.exc_info] == ["no network"]
