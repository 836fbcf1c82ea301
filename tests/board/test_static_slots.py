"""Slots that are not reconfigurable: what they hold, and that nothing is ever written to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from small_board import BITSTREAM_BYTES, Log, Tickets, logging_thread, small_board, small_profile, stages

from reconros_zenoh import VirtualProject
from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.build import build
from reconros_zenoh.errors import BitstreamError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.template import new_project

if TYPE_CHECKING:
    from pathlib import Path

WRITE_NS = BITSTREAM_BYTES // 2
TIMES = {"fixed": (0, 100), "loaded": (0, 100)}


class Board:
    """A board whose slot 0 holds the callback `fixed`, and whose slot 1 takes `loaded`."""

    def __init__(self, bitstreams: Path | None = None) -> None:
        self.board = small_board(small_profile(TIMES), 2, static=[0])
        self.executor = Executor(self.board, 0, 2, bitstreams)
        self.log: Log = []
        self.sources = {"fixed": Tickets(self.board), "loaded": Tickets(self.board)}
        for slot, (name, source) in enumerate(self.sources.items()):
            thread = logging_thread(self.log, name)
            self.executor.add_hw_callback(name, [slot], CallbackKind.SUB, source, thread)


def test_its_callback_waits_for_nobodys_bitstream() -> None:
    case = Board()
    case.executor.spin()
    case.sources["loaded"].put_at(0)
    case.sources["fixed"].put_at(10, 500)
    case.board.environment.run(until=10_000)
    assert case.log == [
        (10, "fixed starts"),
        (110, "fixed is done"),
        (500, "fixed starts"),
        (600, "fixed is done"),
        (WRITE_NS, "loaded starts"),
        (WRITE_NS + 100, "loaded is done"),
    ]
    assert [stages(timeline) for timeline in case.sources["fixed"].timelines] == [{"execution": 100}] * 2
    fixed, loaded = case.board.slots.values()
    assert (fixed.reconfigurations, loaded.reconfigurations) == (0, 1)


def test_it_holds_its_callback_from_the_start() -> None:
    case = Board()
    case.executor.spin()
    assert [slot.holds and slot.holds.callback for slot in case.board.slots.values()] == ["fixed", None]


def test_a_second_callback_is_refused() -> None:
    case = Board()
    source = Tickets(case.board)
    thread = logging_thread(case.log, "loaded")
    with pytest.raises(
        UsageError, match="'loaded' cannot be in slot 0, which is for fixed and is not reconf"
    ):
        case.executor.add_hw_callback("loaded", [0], CallbackKind.SUB, source, thread)


def test_a_callback_that_is_added_too_late_takes_no_slot() -> None:
    board = small_board(small_profile(TIMES), 2, static=[0])
    executor = Executor(board, 0, 2)
    source = Tickets(board)
    executor.add_hw_callback("loaded", [1], CallbackKind.SUB, source, logging_thread([], "loaded"))
    executor.spin()
    with pytest.raises(UsageError, match="spins already"):
        executor.add_hw_callback("fixed", [0], CallbackKind.SUB, source, logging_thread([], "fixed"))
    assert (board.slots[0].holds, board.slots[0].tenants) == (None, set())


def test_it_needs_no_bitstream_file(tmp_path: Path) -> None:
    with pytest.raises(BitstreamError, match=r"pblock_slot_1_loaded_1_partial\.bit"):
        Board(tmp_path).executor.spin()
    Bitstream(1, "loaded", BITSTREAM_BYTES).write(tmp_path)
    Board(tmp_path).executor.spin()


def test_a_project_without_reconfigurable_slots_runs_in_hardware(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "blink"
    new_project(folder)
    for mapping in (folder / "mappings").iterdir():
        mapping.unlink()
    text = (folder / "build.cfg").read_text()
    (folder / "build.cfg").write_text(text.replace("Reconfigurable = true", "Reconfigurable = false"))
    blink = VirtualProject(folder)
    blink.run(1.05)
    (slot,) = blink.status()["slots"]
    assert (slot["holds"], slot["reconfigurations"]) == ("count", 0)
    count = blink.status()["callbacks"]["count"]
    assert (count["slots"], count["software"], count["calls"]) == ([0], False, 10)
    assert load_project(folder).bitstreams(read_profile("native")) == []
    build(folder)
    assert "no callback that is built for a reconfigurable slot" in capsys.readouterr().out
