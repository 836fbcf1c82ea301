"""Experiments in wall time tell on the terminal where the host was too slow for the model."""

from __future__ import annotations

import io

from rich.console import Console

from reconros_zenoh.cli import design, gateway_experiment
from reconros_zenoh.measure.design_report import FIGURES

LATE = "Once a computation took longer on this computer than the board is modelled to need."


def test_the_design_example_tells_it_of_each_variant() -> None:
    times_ms = {"median": 1.0, "p95": 2.0}
    variant = {**dict.fromkeys(FIGURES, 1), "filter_ms": times_ms, "control_ms": times_ms}
    hosts = {name: {"overruns": count, "lag_p99_us": 90.0} for name, count in {"one": 1, "two": 0}.items()}
    stream = io.StringIO()
    design._print_table(
        Console(file=stream, width=200), {name: variant | {"host": host} for name, host in hosts.items()}
    )
    lines = stream.getvalue().splitlines()
    assert [line for line in lines if line.startswith("host")] == [f"host, one: {LATE}"]


def test_the_gateway_experiment_tells_it() -> None:
    stream = io.StringIO()
    for overruns in (0, 1):
        result = {"cells": [], "anchors": [], "host": {"machine": "any", "overruns": overruns}}
        gateway_experiment._print(Console(file=stream, width=200), result)
    assert stream.getvalue().splitlines() == [f"host: {LATE}"]
