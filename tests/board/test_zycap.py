"""One configuration port: how long a write takes, who waits for it, and when none is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_board import BITSTREAM_BYTES, small_board, small_profile, start

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    import simpy
    from small_board import Steps

    from reconros_zenoh.board.board import Board

OFFSET_NS = 70
RECOVERY_NS = 40
WRITE_NS = BITSTREAM_BYTES // 2 + OFFSET_NS  # t_rc = S / B + t_offset at two bytes per nanosecond


def board_with_slots(slots: int, *, stalled: bool = False, cores: int = 1, dds_message_ns: int = 0) -> Board:
    return small_board(
        small_profile(
            icap_offset_ns=OFFSET_NS,
            recovery_ns=RECOVERY_NS,
            stalled=stalled,
            cores=cores,
            dds_message_ns=dds_message_ns,
        ),
        slots,
    )


def write(board: Board, log: list[tuple[int, str]], slot: int, callback: str) -> simpy.Event:
    def run() -> Steps:
        yield from board.zycap.write_bitstream(board.slots[slot], Bitstream(slot, callback, BITSTREAM_BYTES))
        log.append((board.environment.now, f"slot {slot} holds {callback}"))

    return start(board.environment, run())


def test_a_write_takes_the_size_over_the_bandwidth_and_the_offset() -> None:
    board = board_with_slots(1)
    log: list[tuple[int, str]] = []
    write(board, log, 0, "sobel")
    board.environment.run()
    assert log == [(1000 + 70, "slot 0 holds sobel")]
    assert board.slots[0].holds == Bitstream(0, "sobel", BITSTREAM_BYTES)
    assert board.slots[0].reconfigurations == 1
    assert board.slots[0].reconfiguration_ns == 1070


def test_the_bandwidth_of_the_profile_counts() -> None:
    zycap = board_with_slots(1).zycap
    assert [zycap.reconfiguration_ns(size) for size in (0, 10, 2_838_976)] == [70, 75, 1_419_558]


def test_two_slots_reconfigured_at_once_queue_for_the_one_icap() -> None:
    board = board_with_slots(3)
    board.environment.run(until=400)
    log: list[tuple[int, str]] = []
    for slot in (1, 0, 2):
        write(board, log, slot, "sobel")
    board.environment.run()
    assert log == [
        (400 + 1070, "slot 1 holds sobel"),
        (400 + 2140, "slot 0 holds sobel"),
        (400 + 3210, "slot 2 holds sobel"),
    ]
    # What a slot waited counts as reconfiguration, too.
    assert [board.slots[slot].reconfiguration_ns for slot in (0, 1, 2)] == [2140, 1070, 3210]


def test_a_slot_that_holds_the_bitstream_is_not_written_even_while_the_icap_is_busy() -> None:
    board = board_with_slots(2)
    log: list[tuple[int, str]] = []
    board.environment.run(until=write(board, log, 0, "sobel"))
    write(board, log, 1, "mnist")
    write(board, log, 0, "sobel")
    board.environment.run()
    assert log == [
        (1070, "slot 0 holds sobel"),
        (1070, "slot 0 holds sobel"),
        (2140, "slot 1 holds mnist"),
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


@pytest.mark.parametrize(
    ("stalled", "expected"),
    [
        (
            True,
            [(700, "thread"), (WRITE_NS, "slot 0 holds sobel"), (WRITE_NS + RECOVERY_NS + 100, "message")],
        ),
        (False, [(200, "message"), (800, "thread"), (WRITE_NS, "slot 0 holds sobel")]),
    ],
    ids=["stalled", "not stalled"],
)
def test_the_communication_stack_stalls_during_a_write_if_the_profile_says_so(
    stalled: bool, expected: list[tuple[int, str]]
) -> None:
    board = board_with_slots(1, stalled=stalled)
    log: list[tuple[int, str]] = []

    def work(name: str, run: Steps) -> Steps:
        yield board.environment.timeout(100)
        yield from run
        log.append((board.environment.now, name))

    write(board, log, 0, "sobel")
    start(board.environment, work("message", board.cpu.run_stack(100, 1)))
    start(board.environment, work("thread", board.cpu.run(600)))
    board.environment.run()
    assert sorted(log) == sorted(expected)


def test_the_stack_does_not_recover_between_two_writes_in_a_row() -> None:
    board = board_with_slots(2, stalled=True)
    log: list[tuple[int, str]] = []

    def message() -> Steps:
        yield from board.cpu.run_stack(60, 1)
        log.append((board.environment.now, "message"))

    write(board, log, 0, "sobel")
    write(board, log, 1, "sobel")
    board.environment.run(until=1)
    start(board.environment, message())
    board.environment.run()
    assert log == [
        (WRITE_NS, "slot 0 holds sobel"),
        (2 * WRITE_NS, "slot 1 holds sobel"),
        (2 * WRITE_NS + RECOVERY_NS + 60, "message"),
    ]


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
