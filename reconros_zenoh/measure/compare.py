"""Our round trips beside those of the real board, and the mappings beside each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from reconros_zenoh.measure.reference.zynq7100 import reference_cells
from reconros_zenoh.measure.statistics import (
    format_error,
    format_ms,
    format_share,
    format_speedup,
    summarise,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rich.console import Console

    from reconros_zenoh.measure.record import Record

LOGGED_MODULO_MS = 1000.0
"""The paper's clients logged the nanosecond part of each difference only, so the reference is modulo 1 s."""

GOOD_ERROR = 0.10
"""A median this close to the real board's counts as met; the board repeats its own within 6 %."""

_FAIR_ERROR = 0.25
_STYLES = {"good": "green", "fair": "yellow", "bad": "red", "": ""}

_REFERENCE_REQUESTS = 1000


def experiment_tables(
    records: Mapping[str, Mapping[str, Record]], *, modelled: bool = True
) -> dict[str, Any]:
    """Return `mappings`, both speedups and `accuracy` for `records[mapping][client]`.

    `mappings.<mapping>.<client>` is the summary with `reference_median_ms` and `median_error` (ours over the
    reference, less one; our times modulo 1 s as the paper's clients logged theirs), None where the real board
    was not measured; the error also where no board is `modelled`. A speedup is all_software over the mapping,
    None where either has no answer; the tables `speedup_of_means` and `speedup_of_medians` are empty if
    all_software was not run. `accuracy` is as `accuracy` returns it.
    """
    mappings = {
        mapping: {client: _cell(mapping, client, record, modelled) for client, record in clients.items()}
        for mapping, clients in records.items()
    }
    return {
        "mappings": mappings,
        "speedup_of_means": _speedups(mappings, "mean_ms"),
        "speedup_of_medians": _speedups(mappings, "median_ms"),
        "accuracy": accuracy(mappings),
    }


def accuracy(mappings: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> dict[str, Any]:
    """Return how close the medians of the cells `mappings[mapping][client]` are to the real board's.

    Over the cells with a `median_error`: how many `cells` there are and how many lie `within_10_percent`, the
    `worst` (`mapping`, `client`, `error`), the `mean_absolute_error` and `mean_absolute_error_without_hash`
    (the hash client logs the period of a timer, which is easy to meet). What has no cell is None.
    """
    errors = {
        (mapping, client): cell["median_error"]
        for mapping, clients in mappings.items()
        for client, cell in clients.items()
        if cell["median_error"] is not None
    }
    worst = max(errors, key=lambda key: abs(errors[key]), default=None)
    return {
        "cells": len(errors),
        "within_10_percent": sum(abs(error) <= GOOD_ERROR for error in errors.values()),
        "worst": worst and {"mapping": worst[0], "client": worst[1], "error": errors[worst]},
        "mean_absolute_error": _mean_absolute(errors.values()),
        "mean_absolute_error_without_hash": _mean_absolute(
            error for (_, client), error in errors.items() if client != "hash"
        ),
    }


def accuracy_sentence(accuracy: Mapping[str, Any]) -> str:
    """Return the accuracy in words."""
    if not accuracy["cells"]:
        return (
            "accuracy: none of these medians can be compared with the real board's. That takes a mapping and "
            "a client that it ran, and a profile that models a board."
        )
    worst = accuracy["worst"]
    without_hash = accuracy["mean_absolute_error_without_hash"]
    return (
        f"accuracy: {accuracy['within_10_percent']} of {accuracy['cells']} medians within 10 % of the real "
        f"board's; mean absolute error {format_share(accuracy['mean_absolute_error'])}"
        + (f" ({format_share(without_hash)} without hash)" if without_hash is not None else "")
        + f"; worst {worst['client']} under {worst['mapping']} ({format_error(worst['error'])})."
    )


def print_tables(console: Console, experiment: Mapping[str, Any]) -> None:
    """Print one row per mapping and client: how many answers, how fast, how far from the real board."""
    title = Text(f"{experiment['experiment']}, {experiment['clock']} clock", style="bold")
    # Narrow enough for 80 columns with the mappings of the paper; longer names are folded, never cut.
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)
    table.add_column("mapping", overflow="fold")
    table.add_column("client", overflow="fold")
    for column in ("n", "lost", "wrong", "median", "p95", "p99", "board", "error", "speedup"):
        table.add_column(column, justify="right", no_wrap=True)
    for mapping, clients in experiment["mappings"].items():
        for client, cell in clients.items():
            speedup = experiment["speedup_of_medians"].get(mapping, {}).get(client)
            table.add_row(
                Text(mapping),
                Text(client),
                str(cell["n"]),
                Text(str(cell["lost"]), style="red" if cell["lost"] else ""),
                Text(str(cell["wrong"]), style="red" if cell["wrong"] else ""),
                *(format_ms(cell[key]) for key in ("median_ms", "p95_ms", "p99_ms", "reference_median_ms")),
                error_text(cell["median_error"]),
                format_speedup(speedup),
            )
        table.add_section()
    console.print(table)
    console.print(Text(accuracy_sentence(experiment["accuracy"])))
    console.print(
        "Times in ms. board: median on the real Zynq Z7100. error: our median against it. "
        f"speedup: median of all_software over this one. {error_note(experiment['requests'])}",
        style="dim",
        highlight=False,
    )


def error_note(requests: int) -> str:
    """Return what to know about the errors of a run with so many requests per client."""
    few = (
        f"The real board's medians are of {_REFERENCE_REQUESTS} requests; of {requests}, one that lies "
        "between two peaks, as mnist's does, can fall on either. "
    )
    return (few if requests < _REFERENCE_REQUESTS else "") + (
        "For the error against the real board our times are taken modulo 1 s, as the paper's clients logged "
        "theirs. All other figures are whole round-trip times."
    )


def error_text(error: float | None) -> Text:
    """Return the relative error of a median for a terminal, in the colour of its grade."""
    return Text(format_error(error), style=_STYLES[grade(error)])


def grade(error: float | None) -> str:
    """Return good, fair or bad for a relative error of a median, nothing for None."""
    if error is None:
        return ""
    if abs(error) <= GOOD_ERROR:
        return "good"
    return "fair" if abs(error) <= _FAIR_ERROR else "bad"


def _cell(mapping: str, client: str, record: Record, modelled: bool) -> dict[str, float | int | None]:
    reference = reference_cells().get(mapping, {}).get(client)
    cell = summarise(record.values_ms, record.lost, record.wrong)
    cell["reference_median_ms"] = reference.median_ms if reference else None
    cell["median_error"] = None
    if reference and modelled and record.values_ms.size:
        logged_ms = np.median(record.values_ms % LOGGED_MODULO_MS)
        cell["median_error"] = float(logged_ms / reference.median_ms - 1)
    return cell


def _mean_absolute(errors: Iterable[float]) -> float | None:
    sizes = [abs(error) for error in errors]
    return float(np.mean(sizes)) if sizes else None


def _speedups(
    mappings: Mapping[str, Mapping[str, dict[str, Any]]], figure: str
) -> dict[str, dict[str, float | None]]:
    software = mappings.get("all_software", {})
    return {
        mapping: {
            client: software[client][figure] / cell[figure]
            if software[client][figure] and cell[figure]
            else None
            for client, cell in clients.items()
            if client in software
        }
        for mapping, clients in mappings.items()
        if software and mapping != "all_software"
    }
