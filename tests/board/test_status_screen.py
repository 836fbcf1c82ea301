"""The status as people read it."""

from __future__ import annotations

import io

from rich.console import Console

from reconros_zenoh.cli.status_screen import print_status

HOST = {
    "overruns": 5,
    "overrun_ms": 1234.5,
    "lag_p50_us": 31.4,
    "lag_p99_us": 99.0,
    "real_time_priority": True,
}
STATUS = {
    "board": "b",
    "profile": "native",
    "executor": "reconros",
    "elapsed_ms": 3000.0,
    "domain": 0,
    "callbacks": {
        "sobel": {
            "kind": "SUB",
            "software": True,
            "slots": [2, 3],
            "timing": {"software": {"basis": "table"}, "slot 0": {"basis": "cycles"}},
            "calls": 7,
            "failed": 1,
            "dropped": 2,
            "running": [
                {"slot": 2, "since_ms": 104.0, "waits_for": "room in /x"},
                {"slot": None, "since_ms": 2995.0, "waits_for": None},
            ],
        }
    },
    "slots": [
        {
            "id": 2,
            "holds": None,
            "reconfigurations": 0,
            "reconfiguration_ms": 0.0,
            "icap_wait_ms": 1.5,
            "busy_ms": 12.25,
        }
    ],
    "use": {"cores": 0.25, "icap": 0.0, "memif": 0.001, "stack": 1.0},
    "publishers": {
        "/out": {"sent": 2, "dropped": 0, "age_p50_ms": 1.5, "age_p95_ms": 2.25, "age_max_ms": 1e4},
        "/full": {"sent": 0, "dropped": 4, "age_p50_ms": None, "age_p95_ms": None, "age_max_ms": None},
        "/idle": {"sent": 0, "dropped": 0, "age_p50_ms": None, "age_p95_ms": None, "age_max_ms": None},
    },
    "gateways": [],
    "hmt": {},
    "spans_ms": {"sobel": {"dds": 1.5, "memif": 0.25}},
    "rejected": {"truncated": 3},
    "host": HOST,
}


def printed(status: dict[str, object]) -> list[str]:
    stream = io.StringIO()
    print_status(Console(file=stream, width=200), status)
    return [" ".join(line.split()) for line in stream.getvalue().splitlines()]


def test_everything_that_the_board_told_is_shown() -> None:
    lines = printed(STATUS)
    assert "board b: profile native, reconros executor, domain 0" in lines
    assert "sobel SUB software, slot 2, slot 3 table, cycles 7 1 2" in lines
    assert "slot holds reconfigured reconfiguring [ms] ICAP wait [ms] busy [ms]" in lines
    assert "2 - 0 0 1.5 12.2" in lines
    assert "sobel holds slot 2 since 0.10 s, for 2.90 s: waits for room in /x" in lines
    assert "sobel runs in software since 3.00 s, for 0.01 s" in lines
    assert "busy: cores 25.0 %, ICAP 0.0 %, MEMIF 0.1 %, DDS stack 100.0 %" in lines
    assert lines[lines.index("mean [ms] sobel") + 2 :][:3] == ["dds 1.5", "memif 0.25", "sum 1.75"]
    head = lines.index("publishes sent dropped age [ms]: median p95 max")
    assert lines[head + 2 :][:3] == ["/out 2 0 1.5 2.25 10000", "/full 0 4 - - -", ""]
    assert "messages refused: truncated 3" in lines
    assert lines[-1] == (
        "host: event loop (real-time priority) late by 31 us (median), 5 results later than modelled "
        "(1234 ms in all)"
    )


def test_the_loop_of_a_board_may_have_normal_priority() -> None:
    lines = printed(STATUS | {"host": HOST | {"real_time_priority": False}})
    assert "event loop (normal priority) late by 31 us" in lines[-1]


def test_what_there_is_nothing_of_is_left_out() -> None:
    text = "\n".join(printed(STATUS | {"rejected": {}, "publishers": {}, "spans_ms": {}, "use": None}))
    for heading in ("gateway", "stream", "refused", "publishes", "mean", "busy:"):
        assert heading not in text


def test_the_stages_of_many_callbacks_stand_in_their_order_and_fit_80_columns() -> None:
    stages = {"overrun": 0.5, "reconfiguration": 24.5, "transport": 1234.5}
    spans_ms = {f"callback_{number}": stages for number in range(9)}
    stream = io.StringIO()
    print_status(Console(file=stream, width=80), STATUS | {"spans_ms": spans_ms})
    lines = stream.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    heads = [line.split()[2:] for line in lines if line.startswith("mean [ms]")]
    assert [name for head in heads for name in head] == list(spans_ms)
    rows = [line.split()[0] for line in lines if line.endswith((" 1234 ", " 24.5 ", " 0.5 ", " 1260 "))]
    assert rows == ["transport", "reconfiguration", "overrun", "sum"] * 2
