"""A board's status for the eye."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args

from rich.text import Text

from reconros_zenoh.board.stages import Stage
from reconros_zenoh.cli.console import print_rows, short_ms

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Console

_CALLBACKS_PER_TABLE = 5
_AGES = ("p50", "p95", "max")
SHARED_PARTS = {"cores": "cores", "icap": "ICAP", "memif": "MEMIF", "stack": "DDS stack"}
"""The keys of a status's `use`, and what the parts are called."""


def print_status(console: Console, status: Mapping[str, Any]) -> None:
    """Print what `board.status` returned as tables."""
    console.print(
        f"board {status['board']}: profile {status['profile']}, {status['executor']} executor, "
        f"domain {status['domain']}",
        highlight=False,
    )
    print_rows(
        console,
        ("callback", "kind", "runs in", "time from", "calls", "failed", "dropped"),
        (
            (name, each["kind"], _places(each), _timing(each), each["calls"], each["failed"], each["dropped"])
            for name, each in status["callbacks"].items()
        ),
    )
    print_rows(
        console,
        ("slot", "holds", "reconfigured", "reconfiguring [ms]", "ICAP wait [ms]", "busy [ms]"),
        (
            (
                slot["id"],
                slot["holds"] or "-",
                slot["reconfigurations"],
                slot["reconfiguration_ms"],
                slot["icap_wait_ms"],
                slot["busy_ms"],
            )
            for slot in status["slots"]
        ),
    )
    _print_running(console, status["callbacks"], status["elapsed_ms"])
    if status["use"] is not None:
        shares = ((name, status["use"][key]) for key, name in SHARED_PARTS.items())
        listed = ", ".join(f"{name} {100 * share:.1f} %" for name, share in shares)
        console.print(f"busy: {listed}\n", highlight=False)
    _print_spans(console, status["spans_ms"])
    print_rows(
        console,
        ("publishes", "sent", "dropped", "age [ms]: median", "p95", "max"),
        (
            (topic, each["sent"], each["dropped"], *(each[f"age_{figure}_ms"] for figure in _AGES))
            for topic, each in status["publishers"].items()
            if each["sent"] or each["dropped"]
        ),
    )
    print_rows(
        console,
        ("stream", "passed", "dropped", "waits for room"),
        ((key, hmt["passed"], hmt["dropped"], hmt["waits"]) for key, hmt in status["hmt"].items()),
    )
    print_rows(
        console,
        ("gateway", "hardware-mapped", "software-mapped", "to hardware", "to software"),
        ((g["name"], g["hmt"], g["smt"], g["to_hmt"], g["to_smt"]) for g in status["gateways"]),
    )
    if status["rejected"]:
        listed = ", ".join(f"{name} {count}" for name, count in status["rejected"].items())
        console.print(Text(f"messages refused: {listed}", style="yellow"))
    _print_host(console, status["host"])


def _print_running(console: Console, callbacks: Mapping[str, Any], elapsed_ms: float) -> None:
    """Print a line for each call that has not ended."""
    for name, callback in callbacks.items():
        for call in callback["running"]:
            place = "runs in software" if call["slot"] is None else f"holds slot {call['slot']}"
            text = f"{name} {place} since {call['since_ms'] / 1e3:.2f} s"
            text += f", for {(elapsed_ms - call['since_ms']) / 1e3:.2f} s"
            if call["waits_for"] is None:
                console.print(Text(text))
            else:
                console.print(Text(f"{text}: waits for {call['waits_for']}", style="yellow"))


def _print_spans(console: Console, spans_ms: Mapping[str, Mapping[str, float]]) -> None:
    """Print where the time of a message goes, in the order of its way: a column for each callback."""
    callbacks = list(spans_ms)
    for first in range(0, len(callbacks), _CALLBACKS_PER_TABLE):
        names = callbacks[first : first + _CALLBACKS_PER_TABLE]
        shown = [spans_ms[name] for name in names]
        stages = [stage for stage in get_args(Stage) if any(stage in each for each in shown)]
        rows = [[stage, *(each.get(stage, 0.0) for each in shown)] for stage in stages]
        print_rows(console, ("mean [ms]", *names), [*rows, ["sum", *(sum(each.values()) for each in shown)]])


def _print_host(console: Console, host: Mapping[str, Any]) -> None:
    lag = ""
    if host["lag_p50_us"] is not None:
        priority = "real-time" if host["real_time_priority"] else "normal"
        lag = f"event loop ({priority} priority) late by {host['lag_p50_us']:.0f} us (median), "
    results = "1 result" if host["overruns"] == 1 else f"{host['overruns']} results"
    console.print(
        Text(
            f"host: {lag}{results} later than modelled ({short_ms(host['overrun_ms'])} ms in all)",
            style="yellow" if host["overruns"] else "",
        )
    )


def _places(callback: Mapping[str, Any]) -> str:
    slots = [f"slot {slot}" for slot in callback["slots"]]
    return ", ".join((["software"] if callback["software"] else []) + slots)


def _timing(callback: Mapping[str, Any]) -> str:
    return ", ".join(dict.fromkeys(str(timing["basis"]) for timing in callback["timing"].values()))
