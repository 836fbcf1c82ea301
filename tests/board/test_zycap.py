"""One configuration port: how long a write takes, who waits for it, and when none is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_board import BITSTREAM_BYTES, Log, small_board, small_profile, start

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    import simpy
    from small_board import Steps

    from reconros_zenoh.board.board import Board

OFFSET_NS = 110
RECOVERY_NS = 40
WRITE_NS = BITSTREAM_BYTES // 2 + OFFSET_NS  # t_rc = S / B + t_offset at two bytes per nanosecond


def board_with_slots(slots: int, *, stalled: bool = False) -> Board:
    profile = small_profile(icap_offset_ns=OFFSET_NS, recovery_ns=RECOVERY_NS, stalled=stalled, cores=1)
    return small_board(profile, slots)


def write(board: Board, log: Log, slot: int, callback: str) -> simpy.Event:
    def run() -> Steps:
        yield from board.zycap.write_bitstream(board.slots[slot], Bitstream(slot, callback, BITSTREAM_BYTES))
        log.append((board.environment.now, f"slot {slot} holds {callback}"))

    return start(board.environment, run())


def work_from(board: Board, log: Log, time_ns: int, name: str, work: Steps) -> None:
    def run() -> Steps:
        yield board.environment.timeout(time_ns)
        yield from work
        log.append((board.environment.now, name))

    start(board.environment, run())


def test_a_write_takes_the_size_over_the_bandwidth_and_the_offset() -> None:
    board = board_with_slots(1)
    log: Log = []
    write(board, log, 0, "sobel")
    board.environment.run()
    assert log == [(1000 + 110, "slot 0 holds sobel")]
    assert board.slots[0].holds == Bitstream(0, "sobel", BITSTREAM_BYTES)
    assert board.slots[0].reconfigurations == 1
    assert board.slots[0].reconfiguring.ns == 1110


def test_the_bandwidth_of_the_profile_counts() -> None:
    zycap = board_with_slots(1).zycap
    assert [zycap.reconfiguration_ns(size) for size in (0, 10, 2_838_976)] == [110, 115, 1_419_598]


def test_two_slots_reconfigured_at_once_queue_for_the_one_icap() -> None:
    board = board_with_slots(3)
    board.environment.run(until=400)
    log: Log = []
    for slot in (1, 0, 2):
        write(board, log, slot, "sobel")
    board.environment.run()
    assert log == [
        (400 + 1110, "slot 1 holds sobel"),
        (400 + 2220, "slot 0 holds sobel"),
        (400 + 3330, "slot 2 holds sobel"),
    ]
    assert [board.slots[slot].reconfiguring.ns for slot in (0, 1, 2)] == [1110] * 3
    assert [board.slots[slot].waiting.ns for slot in (0, 1, 2)] == [1110, 0, 2220]


def test_a_slot_that_holds_the_bitstream_is_not_written_even_while_the_icap_is_busy() -> None:
    board = board_with_slots(2)
    log: Log = []
    board.environment.run(until=write(board, log, 0, "sobel"))
    write(board, log, 1, "mnist")
    write(board, log, 0, "sobel")
    board.environment.run()
    assert log == [
        (1110, "slot 0 holds sobel"),
        (1110, "slot 0 holds sobel"),
        (2220, "slot 1 holds mnist"),
    ]
    assert board.slots[0].reconfigurations == 1


def test_a_slot_is_empty_while_it_is_written() -> None:
    board = board_with_slots(1)
    board.environment.run(until=write(board, [], 0, "sobel"))
    write(board, [], 0, "mnist")
    board.environment.run(until=board.environment.now + 1)
    assert board.slots[0].holds is None


@given(st.lists(st.tuples(st.integers(0, 2), st.sampled_from(["sobel", "mnist", "hash"])), max_size=30))
def test_a_slot_is_written_if_and_only_if_it_does_not_hold_that_bitstream(
    wanted: list[tuple[int, str]],
) -> None:
    board = board_with_slots(3)
    holds: dict[int, str] = {}
    changes = dict.fromkeys(board.slots, 0)
    for slot, callback in wanted:
        before_ns = board.environment.now
        board.environment.run(until=write(board, [], slot, callback))
        differs = holds.get(slot) != callback
        assert board.environment.now - before_ns == (WRITE_NS if differs else 0)
        changes[slot] += differs
        holds[slot] = callback
        in_slot = board.slots[slot].holds
        assert in_slot is not None
        assert in_slot.callback == callback
    assert {slot: board.slots[slot].reconfigurations for slot in board.slots} == changes


def test_the_communication_stack_stalls_during_a_write_and_until_it_has_recovered() -> None:
    board = board_with_slots(1, stalled=True)
    log: Log = []
    write(board, log, 0, "sobel")
    work_from(board, log, 100, "message", board.cpu.run_stack(100, share=1))
    work_from(board, log, 100, "thread", board.cpu.run(600))
    board.environment.run()
    assert log == [
        (700, "thread"),
        (1110, "slot 0 holds sobel"),  # the slot need not wait for the stack
        (1110 + 40 + 100, "message"),
    ]


def test_a_message_that_is_in_work_when_a_write_begins_waits_too() -> None:
    board = board_with_slots(1, stalled=True)
    log: Log = []
    work_from(board, log, 0, "message", board.cpu.run_stack(100, share=1))
    board.environment.run(until=70)
    write(board, log, 0, "sobel")
    board.environment.run()
    assert log == [(70 + 1110, "slot 0 holds sobel"), (70 + 1110 + 40 + 30, "message")]


def test_the_communication_stack_goes_on_during_a_write_if_the_profile_says_so() -> None:
    board = board_with_slots(1, stalled=False)
    log: Log = []
    write(board, log, 0, "sobel")
    work_from(board, log, 100, "message", board.cpu.run_stack(100, share=1))
    work_from(board, log, 100, "thread", board.cpu.run(600))
    board.environment.run()
    assert log == [(200, "message"), (800, "thread"), (1110, "slot 0 holds sobel")]


def test_the_stack_stalls_over_two_writes_until_it_has_recovered_from_the_second() -> None:
    board = board_with_slots(2, stalled=True)
    log: Log = []
    write(board, log, 0, "sobel")
    write(board, log, 1, "sobel")
    work_from(board, log, 1, "message", board.cpu.run_stack(60, share=1))
    board.environment.run()
    assert log == [
        (1110, "slot 0 holds sobel"),
        (2220, "slot 1 holds sobel"),
        (2220 + 40 + 60, "message"),
    ]


def test_a_write_that_is_skipped_stalls_nothing() -> None:
    board = board_with_slots(1, stalled=True)
    log: Log = []
    board.environment.run(until=write(board, [], 0, "sobel"))
    board.environment.run(until=2000)
    write(board, log, 0, "sobel")
    work_from(board, log, 0, "message", board.cpu.run_stack(60, share=1))
    board.environment.run()
    assert log == [(2000, "slot 0 holds sobel"), (2060, "message")]


def test_prefetched_bitstreams_are_at_hand_until_deinit() -> None:
    zycap = board_with_slots(1).zycap
    sobel = Bitstream(0, "sobel", BITSTREAM_BYTES)
    zycap.init({(0, "sobel"): sobel})
    assert zycap.bitstream(0, "sobel") is sobel
    with pytest.raises(UsageError, match="no bitstream of callback 'hash' for slot 0"):
        zycap.bitstream(0, "hash")
    zycap.deinit()
    with pytest.raises(UsageError, match="no bitstream of callback 'sobel' for slot 0"):
        zycap.bitstream(0, "sobel")
