"""The executor on a board: what may be registered, and what it needs before it spins."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import pytest
from small_board import BITSTREAM_BYTES, Log, Tickets, ignore, logging_thread, small_board, small_profile

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.board.board import Board
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.errors import BitstreamError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from pathlib import Path

    from reconros_zenoh.board.executor import ExecutorKind

PROFILE = small_profile({"a": (10, 10), "b": (10, 10)})
SUB = CallbackKind.SUB


def test_every_hardware_worker_needs_a_slot() -> None:
    with pytest.raises(UsageError, match="hardware_workers = 3 is more than the slots of the project: 2"):
        Executor(small_board(PROFILE, 2), 0, 3)


@pytest.mark.parametrize("workers", [(-1, 0), (0, -1)])
def test_no_executor_has_fewer_workers_than_none(workers: tuple[int, int]) -> None:
    with pytest.raises(UsageError, match="there cannot be -1 workers"):
        Executor(small_board(PROFILE, 2), *workers)


def test_the_standard_executor_knows_no_hardware() -> None:
    with pytest.raises(
        UsageError, match='standard executor has no hardware workers; use executor = "reconros"'
    ):
        Executor(small_board(PROFILE, 2), 2, 1, kind="standard")


def test_a_software_callback_needs_a_software_worker() -> None:
    board = small_board(PROFILE, 1)
    with pytest.raises(UsageError, match="'a' runs in software, but there are no software workers"):
        Executor(board, 0, 1).add_sw_callback("a", SUB, Tickets(board), ignore)


def generator(_: object, __: object) -> Any:
    yield


async def coroutine(_: object, __: object) -> None:
    pass


async def asynchronous_generator(_: object, __: object) -> Any:
    yield


class Called:
    def __call__(self, _: object, __: object) -> Any:
        yield

    method = generator


@pytest.mark.parametrize(
    "function",
    [
        generator,
        coroutine,
        asynchronous_generator,
        partial(generator, 1),
        partial(partial(Called()), 1),
        Called(),
        Called().method,
    ],
)
def test_a_software_callback_that_a_call_would_not_run_is_refused(function: Any) -> None:
    board = small_board(PROFILE)
    executor = Executor(board, 1, 0)
    with pytest.raises(UsageError, match="'a' has `yield` or `async`: in software it would never run"):
        executor.add_sw_callback("a", SUB, Tickets(board), function)
    assert not executor.statistics()


class Plain:
    def __call__(self, _: object, __: object) -> None:
        pass


@pytest.mark.parametrize("function", [ignore, partial(ignore), Plain(), Plain, print, "".join])
def test_everything_else_that_can_be_called_is_a_software_callback(function: Any) -> None:
    board = small_board(PROFILE)
    Executor(board, 1, 0).add_sw_callback("a", SUB, Tickets(board), function)


def test_a_hardware_callback_needs_a_slot_that_a_worker_serves() -> None:
    board = small_board(PROFILE, 2)
    with pytest.raises(
        UsageError, match=r"'a' needs slot 1, which no hardware worker serves\. They serve 0\."
    ):
        Executor(board, 0, 1).add_hw_callback("a", [0, 1], SUB, Tickets(board), logging_thread([], "a"))


def test_hardware_workers_serve_the_slots_with_the_lowest_ids() -> None:
    board = small_board(PROFILE, 3)
    board.slots = dict(sorted(board.slots.items(), reverse=True))
    executor = Executor(board, 0, 2)
    for slot in (0, 1):
        executor.add_hw_callback("ab"[slot], [slot], SUB, Tickets(board), logging_thread([], "a"))
    with pytest.raises(UsageError, match="slot 2"):
        executor.add_hw_callback("a", [2], SUB, Tickets(board), logging_thread([], "a"))


def test_a_profile_without_times_for_a_callback() -> None:
    board = small_board(PROFILE)
    with pytest.raises(UsageError) as caught:
        Executor(board, 1, 0).add_sw_callback("walk", SUB, Tickets(board), ignore)
    assert str(caught.value) == (
        "profile 'small' has no times for callback 'walk'. Add the callback with timing=Cycles(n) or "
        "timing=Native(factor), in app.register software_timing, or add a section [model.callbacks.walk] to "
        "a copy of the profile."
    )


def test_the_native_profile_needs_no_times() -> None:
    board = small_board(read_profile("native"))
    Executor(board, 1, 0).add_sw_callback("walk", SUB, Tickets(board), ignore)


def test_what_is_added_too_late_is_refused_and_so_is_a_second_spin() -> None:
    board = small_board(PROFILE, 1)
    executor = Executor(board, 1, 1)
    executor.add_sw_callback("a", SUB, Tickets(board), ignore)
    executor.spin()
    with pytest.raises(UsageError, match="'b' is added to an executor that spins already"):
        executor.add_sw_callback("b", SUB, Tickets(board), ignore)
    with pytest.raises(UsageError, match="the executor spins already"):
        executor.spin()
    assert list(executor.statistics()) == ["a"]


def test_two_callbacks_of_one_name() -> None:
    board = small_board(PROFILE)
    executor = Executor(board, 1, 0)
    executor.add_sw_callback("a", SUB, Tickets(board), ignore)
    with pytest.raises(UsageError, match="'a' is registered already with another source"):
        executor.add_sw_callback("a", SUB, Tickets(board), ignore)


def test_where_each_callback_may_run() -> None:
    board = small_board(PROFILE, 2)
    executor = Executor(board, 1, 2)
    source = Tickets(board)
    executor.add_hw_callback("a", [1, 0], SUB, source, logging_thread([], "a"))
    executor.add_sw_callback("a", SUB, source, ignore)
    executor.add_sw_callback("b", CallbackKind.SRV, Tickets(board), ignore)
    assert executor.statistics() == {
        "a": {
            "kind": "SUB",
            "software": True,
            "slots": [0, 1],
            "timing": {
                "software": {"basis": "table", "ms": 0.00001},
                "slot 0": {"basis": "table", "ms": 0.00001},
                "slot 1": {"basis": "table", "ms": 0.00001},
            },
            "calls": 0,
            "failed": 0,
            "dropped": 0,
            "running": [],
        },
        "b": {
            "kind": "SRV",
            "software": True,
            "slots": [],
            "timing": {"software": {"basis": "table", "ms": 0.00001}},
            "calls": 0,
            "failed": 0,
            "dropped": 0,
            "running": [],
        },
    }


class Loaded:
    """An executor with callback a for slots 0 and 1, whose bitstreams stand in a folder."""

    def __init__(self, folder: Path | None) -> None:
        self.board = small_board(PROFILE, 2)
        self.log: Log = []
        self.source = Tickets(self.board)
        self.executor = Executor(self.board, 0, 2, folder)
        self.executor.add_hw_callback("a", [0, 1], SUB, self.source, logging_thread(self.log, "a"))

    def spin(self) -> Log:
        self.executor.spin()
        self.source.put(1)
        self.board.environment.run(until=5000)
        return self.log


def test_bitstreams_come_from_their_folder(tmp_path: Path) -> None:
    for slot in (0, 1):
        Bitstream(slot, "a", BITSTREAM_BYTES).write(tmp_path)
    assert Loaded(tmp_path).spin() == [(1000, "a starts"), (1010, "a is done")]


def test_without_a_folder_bitstreams_are_held_in_memory_only() -> None:
    assert Loaded(None).spin() == [(1000, "a starts"), (1010, "a is done")]


def test_every_bitstream_has_to_be_there_before_it_spins(tmp_path: Path) -> None:
    Bitstream(0, "a", BITSTREAM_BYTES).write(tmp_path)
    with pytest.raises(BitstreamError, match=r"pblock_slot_1_a_1_partial.bit: cannot be read"):
        Loaded(tmp_path).spin()


def test_a_bitstream_for_a_slot_of_another_size(tmp_path: Path) -> None:
    for slot in (0, 1):
        Bitstream(slot, "a", 1999).write(tmp_path)
    with pytest.raises(BitstreamError, match="has 1999 bytes; this slot takes 2000"):
        Loaded(tmp_path).spin()


def test_a_closed_board_holds_no_bitstream() -> None:
    loaded = Loaded(None)
    loaded.spin()
    loaded.board.close()
    with pytest.raises(UsageError, match="no bitstream"):
        loaded.board.zycap.bitstream(0, "a")


@pytest.mark.parametrize("kind", ["standard", "reconros"])
def test_a_closed_board_ends_its_callback_and_begins_no_other(kind: ExecutorKind) -> None:
    board = small_board(small_profile(dict.fromkeys("ab", (10, 10))))
    executor = Executor(board, 1, 0, kind=kind)
    sources = {name: Tickets(board) for name in "ab"}
    for name, source in sources.items():
        executor.add_sw_callback(name, SUB, source, ignore)
        source.put_at(0, 0, 100)
    executor.spin()
    board.environment.run(until=5)
    board.close()
    board.environment.run(until=200)
    assert executor.calls == {"a": 1}
    assert sources["a"].answers == [(0, None)]


def test_seed_and_name_decide_which_messages_are_lost() -> None:
    def draws(name: str, seed: int) -> list[float]:
        like = small_board(PROFILE)
        board = Board(like.environment, like.context, PROFILE, (), name=name, seed=seed)
        return [board.dds._randomness.random() for _ in range(3)]

    assert draws("left", 1) == draws("left", 1)
    assert draws("left", 1) != draws("left", 2)
    assert draws("left", 1) != draws("right", 1)
