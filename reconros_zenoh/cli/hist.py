"""`reconros hist`: the distribution of recorded round-trip times."""

from __future__ import annotations

import json
import os
from operator import attrgetter
from pathlib import Path
from typing import Annotated

import typer

from reconros_zenoh.cli.console import wide_console
from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.histogram import NamedRecord, describe, print_histogram
from reconros_zenoh.measure.plots import write_histograms
from reconros_zenoh.measure.record import find_records, read_record, short_names


def hist(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR|FILE...",
            help="Folders, searched for *.csv, or record files: those of an experiment, or any times in ms "
            "separated by ; or , or line breaks.",
            show_default=False,
        ),
    ],
    compare: Annotated[
        Path | None,
        typer.Option(
            metavar="OTHER",
            help="Show another distribution beside each: that of a file, or of the record with the same "
            "mapping/client in a folder; with the same client, if the mappings have nothing in common.",
            show_default=False,
        ),
    ] = None,
    png: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the histograms to a PNG file too.", show_default=False),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object with figures, bins and counts instead.")
    ] = False,
    bins: Annotated[int, typer.Option(min=1, max=1000, metavar="N", help="Number of bins.")] = 20,
) -> None:
    """Show a histogram and percentiles of each record of times.

    All values of a file count: no warm-up is dropped. The bins run from the 0.5th to the 97.5th percentile
    (over all of fewer than 40 values); the number of values outside is shown.
    """
    entries = _load(paths)
    pairs = [(entry, None) for entry in entries] if compare is None else _pair(entries, compare)
    if png:
        write_histograms(png, pairs, bins)
    if as_json:
        print(json.dumps({"records": [describe(entry, other, bins) for entry, other in pairs]}, indent=2))
        return
    console = wide_console(60)
    for entry, other in pairs:
        print_histogram(console, entry, other, bins)
    if alone := [entry.name for entry, other in pairs if compare and not other]:
        console.print(f"not in {compare}: {', '.join(alone)}", highlight=False)
    if png:
        console.print(f"drawn to {png}", highlight=False)


def _load(paths: list[Path]) -> list[NamedRecord]:
    files = [file for path in paths for file in (find_records(path) if path.is_dir() else [path])]
    # A second way to the same file is not a second record.
    files = list({os.path.realpath(file): file for file in reversed(files)}.values())[::-1]
    return [
        NamedRecord(name, file, read_record(file))
        for name, file in zip(short_names(files), files, strict=True)
    ]


def _pair(entries: list[NamedRecord], compare: Path) -> list[tuple[NamedRecord, NamedRecord | None]]:
    others = _load([compare])
    if not compare.is_dir():
        return [(entry, others[0]) for entry in entries]
    names = [attrgetter("name")]
    if len({other.path.parent for other in others}) == 1:  # else a client has several records there
        names.append(attrgetter("path.stem"))
    for name in names:
        by_name = {name(other): other for other in others}
        pairs = [(entry, by_name.get(name(entry))) for entry in entries]
        if any(other for _, other in pairs):
            return pairs
    raise UsageError(
        f"{compare}: none of its records ({others[0].name}, ...) is called like one of those given "
        f"({entries[0].name}, ...). Give a folder with the same mapping/client names, or a file."
    )
