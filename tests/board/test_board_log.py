"""A line of the log says which board it is from, which callback, and when on the board's clock."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from small_board import Tickets, small_board, small_profile

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    import pytest

    from reconros_zenoh.board.software import SoftwareContext


def test_board_callback_and_time(caplog: pytest.LogCaptureFixture) -> None:
    def callback(message: int, context: SoftwareContext) -> None:
        context.log.info("got %d", message, extra={"own": 7})
        raise ValueError(message)

    environment = VirtualEnvironment()
    environment.run(until=1_000_000)  # others may run before a board begins
    board = small_board(small_profile({"a": (100, 100)}), environment=environment)
    executor, source = Executor(board, 1, 0), Tickets(board)
    executor.add_sw_callback("a", CallbackKind.SUB, source, callback)
    executor.spin()
    source.put_at(3_000_000)
    with caplog.at_level(logging.INFO):
        environment.run(until=6_000_000)
        board.log.info("done")
    said, failed, done = caplog.records
    assert (said.name, said.getMessage(), said.own) == (f"reconros_zenoh.{board.name}.a", "got 3000000", 7)
    assert (failed.name, failed.levelno) == (f"reconros_zenoh.{board.name}", logging.ERROR)
    assert (said.elapsed_ms, failed.elapsed_ms, done.elapsed_ms) == (2.0, 2.0001, 5.0)
