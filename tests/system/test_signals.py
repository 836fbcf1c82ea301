"""Ctrl-C, SIGTERM and SIGHUP end each process well; a router that goes takes nobody with it."""

from __future__ import annotations

import os
import time
from signal import SIGINT, SIGKILL, Signals
from threading import Condition
from typing import TYPE_CHECKING

import pytest
from processes import LIMIT_S, Process

from reconros_zenoh.board.control import ask_status
from reconros_zenoh.clock.signals import ENDING
from reconros_zenoh.errors import TransportError
from reconros_zenoh.ros.names import data_key
from reconros_zenoh.ros.qos import QosProfile
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Network

    from reconros_zenoh.ros.type_registry import TypeRegistry
    from reconros_zenoh.transport.base import Sample

each_signal = pytest.mark.parametrize("number", ENDING, ids=lambda number: number.name)
ENDLESS = "--requests=1000000"


class InverseRequests:
    """Counts the requests of the inverse client in the network."""

    def __init__(self, transport: ZenohTransport, types: TypeRegistry) -> None:
        self._changed = Condition()
        self._count = 0
        number = types.message("std_msgs/msg/UInt32")
        transport.subscribe(
            data_key(0, "/angle", number.dds_name, number.type_hash), self._note, QosProfile()
        )

    def wait_for_more(self, count: int) -> None:
        """Return when so many more have been made."""
        with self._changed:
            wanted = self._count + count
            assert self._changed.wait_for(lambda: self._count >= wanted, LIMIT_S)

    def _note(self, _: Sample) -> None:
        with self._changed:
            self._count += 1
            self._changed.notify_all()


def outcomes(record: Path, client: Process) -> list[str]:
    """Return the outcomes in the record; fail unless it holds every round trip that the client counts."""
    header, *lines = record.read_text(encoding="ascii").splitlines()
    assert header == "index,round_trip_ms,outcome"
    fields = [line.split(",") for line in lines]
    assert [index for index, _, _ in fields] == [str(i) for i in range(len(lines))]
    found = [outcome for _, _, outcome in fields]
    lost, wrong = found.count("lost"), found.count("wrong")
    (summary,) = client.out
    assert summary.startswith(f"inverse: {len(found) - lost} answers, {lost} lost, {wrong} wrong, ")
    return found


@each_signal
def test_an_interrupted_client_keeps_its_record(
    network: Network, types: TypeRegistry, tmp_path: Path, number: Signals
) -> None:
    requests = InverseRequests(network.transport, types)
    record = tmp_path / "inverse.csv"
    with Process("client", "inverse", ENDLESS, "--router", network.endpoint, "--out", record) as client:
        # The first is not recorded, and the last has no answer yet.
        requests.wait_for_more(12)
        assert client.end(number) == 130
        assert outcomes(record, client).count("ok") >= 10
        assert client.err == []


@each_signal
@pytest.mark.parametrize("earlier", [0, 1])
def test_router_and_board_end_without_complaint(endpoint: str, number: Signals, earlier: int) -> None:
    with (
        Process("router", "--listen", endpoint) as router,
        Process("board", "--router", endpoint) as board,
    ):
        board.wait_for("board board0 serves roundtrip")
        for process in (board, router):
            for _ in range(earlier):  # `timeout` sends two
                os.kill(process.pid, number)
            assert process.end(number) == 0
            assert len(process.out) == 1
            assert process.err == []


def test_board_and_client_go_on_without_a_router_and_find_the_next(
    endpoint: str, types: TypeRegistry, tmp_path: Path
) -> None:
    record = tmp_path / "inverse.csv"
    with (
        Process("router", "--listen", endpoint) as router,
        Process("board", "--router", endpoint) as board,
        Process("client", "inverse", ENDLESS, "--router", endpoint, "--out", record) as client,
    ):
        router.wait_for("router listens")
        with ZenohTransport.open(endpoint) as transport:
            requests = InverseRequests(transport, types)
            requests.wait_for_more(50)
            assert router.end(SIGKILL) == -SIGKILL
            requests.wait_for_more(100)
        assert board.runs
        with Process("router", "--listen", endpoint) as next_router:
            next_router.wait_for("router listens")
            assert _calls(endpoint, "inverse") > 100
            assert client.end(SIGINT) == 130
        # What was on its way through the router may be lost.
        assert outcomes(record, client).count("ok") > 100
        assert board.end(SIGINT) == 0
        assert client.err == board.err == []


def _calls(endpoint: str, callback: str) -> int:
    """Return how often the board has run the callback, once it has come back to the router."""
    end = time.monotonic() + LIMIT_S
    with ZenohTransport.open(endpoint) as transport:
        while True:
            try:
                return int(ask_status(transport, "board0")["callbacks"][callback]["calls"])
            except TransportError:
                if time.monotonic() > end:
                    raise
