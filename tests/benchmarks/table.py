"""What the benchmarks share: arguments, and their result as a table or as JSON."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


def arguments(description: str) -> argparse.ArgumentParser:
    """Return a parser with --json."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    return parser


def print_result(benchmark: str, rows: Sequence[Mapping[str, Any]], *, as_json: bool) -> None:
    """Print the rows, which have the same columns."""
    if as_json:
        print(json.dumps({"benchmark": benchmark, "rows": list(rows)}))
        return
    table = Table(title=benchmark, title_justify="left")
    for name in rows[0]:
        table.add_column(name.replace("_", " "), justify="right")
    for row in rows:
        table.add_row(*(f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row.values()))
    Console(width=130).print(table)
