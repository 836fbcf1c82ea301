"""`python -m host_clients`, which is `reconros client`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from processes import run

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Network


def test_a_client_records_and_prints_its_round_trips(network: Network, tmp_path: Path) -> None:
    record = tmp_path / "new folder" / "sort.csv"
    done = run(
        *("sort", "--requests=3", "--router", network.endpoint, "--out", record, "--json"),
        program=("-m", "host_clients"),
    )
    assert (done.returncode, done.stderr) == (0, "")
    summary = json.loads(done.stdout)
    assert {name: summary[name] for name in ("client", "requests", "n", "lost", "wrong")} == {
        "client": "sort",
        "requests": 3,
        "n": 3,
        "lost": 0,
        "wrong": 0,
    }
    lines = [line.split(",") for line in record.read_text(encoding="ascii").splitlines()]
    assert [(index, outcome) for index, _, outcome in lines] == [
        ("index", "outcome"),
        ("0", "ok"),
        ("1", "ok"),
        ("2", "ok"),
    ]
    assert sorted(float(time) for _, time, _ in lines[1:])[1] == pytest.approx(summary["median_ms"])
