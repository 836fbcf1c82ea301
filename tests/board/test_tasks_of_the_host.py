"""In wall time the host remembers how long a task takes: by what it is called, not by the callable."""

from __future__ import annotations

import gc
import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest
from small_board import Tickets, small_board, small_profile

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread


@dataclass
class Sorting:
    """A callable without a hash, as every dataclass that can be compared and changed."""

    reverse: bool

    def __call__(self, numbers: list[int], _: object = None) -> list[int]:
        return sorted(numbers, reverse=self.reverse)


def served_in_wall_time(add: Callable[[Executor, Tickets], None], tickets: Sequence[object]) -> Tickets:
    """Have a board with the callback `a` serve the tickets one after another."""
    environment = WallEnvironment()
    board = small_board(small_profile({"a": (0, 0)}), 1, environment=environment, threads=1)
    executor = Executor(board, software_workers=1, hardware_workers=1)
    source = Tickets(board)
    add(executor, source)
    executor.spin()
    for ticket in tickets:
        environment.call_later(0, source.put, ticket)
        done = environment.event()
        source.on_answer = done.succeed
        environment.run(until=done)
    board.close()
    assert executor.statistics()["a"]["failed"] == 0
    return source


@pytest.mark.parametrize("in_hardware", [True, False], ids=["hardware", "software"])
def test_in_wall_time_a_callable_needs_no_hash(in_hardware: bool) -> None:
    sorting = Sorting(reverse=True)

    def thread(thread: HardwareThread) -> Steps:
        numbers = yield from thread.get_init_data()
        return (yield from thread.compute(sorting, numbers))

    def add(executor: Executor, source: Tickets) -> None:
        if in_hardware:
            executor.add_hw_callback("a", [0], CallbackKind.SRV, source, thread)
        else:
            executor.add_sw_callback("a", CallbackKind.SRV, source, sorting)

    source = served_in_wall_time(add, [[1, 3, 2]])
    assert source.answers == [([1, 3, 2], [3, 2, 1])]


def test_in_wall_time_nothing_is_kept_of_the_kernels_that_a_callback_makes() -> None:
    seen: list[Any] = []
    tasks: list[int] = []

    def thread(thread: HardwareThread) -> Steps:
        for _ in range(150):
            held = Sorting(reverse=False)
            seen.append(weakref.ref(held))
            yield from thread.compute(lambda held=held: held([2, 1]))
        tasks.append(len(thread._board.host._expected_ns))

    def add(executor: Executor, source: Tickets) -> None:
        executor.add_hw_callback("a", [0], CallbackKind.SUB, source, thread)

    served_in_wall_time(add, ["ticket", "another"])
    gc.collect()
    assert [held() for held in seen] == [None] * 300
    assert tasks == [100, 100]
