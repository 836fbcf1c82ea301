"""What a board costs among many: clones of the demo's board with their five clients in one process.

Goal: with 10 and with 100 boards, time and memory per board are at most 1.2 times those of one board alone.
Each number of boards has a process of its own. Memory is how far its peak rises over what the imports took.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from table import arguments, print_result

FILE = Path(__file__).parents[2] / "deploy" / "roundtrip.yaml"
BOARDS = (1, 10, 100)


def peak_mib() -> float:
    """Return the largest resident set of this process so far [MiB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def simulate(boards: int, requests: int) -> dict[str, float]:
    """Run the clones and return the time [s] and memory [MiB] that it took."""
    # The process that starts the others stays small: on Linux a child's peak begins with its parent's size.
    from reconros_zenoh.cli.service_commands import read_deployment  # noqa: PLC0415
    from reconros_zenoh.experiments.deployment import DeploymentRun  # noqa: PLC0415

    before_mib, started = peak_mib(), time.perf_counter()
    plan = read_deployment(FILE, os.environ).changed(requests, 0)
    run = DeploymentRun([plan.clone(number) for number in range(boards)])
    run.run(lambda: None)
    return {"seconds": time.perf_counter() - started, "mib": peak_mib() - before_mib}


def main() -> None:
    """Run the benchmark."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--requests", type=int, default=200, help="requests per client")
    parser.add_argument("--boards", type=int, help="be the process with this many boards")
    given = parser.parse_args()
    if given.boards:
        print(json.dumps(simulate(given.boards, given.requests)))
        return
    rows: list[dict[str, Any]] = []
    for boards in BOARDS:
        command = [sys.executable, __file__, f"--boards={boards}", f"--requests={given.requests}"]
        took = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
        row = {
            "boards": boards,
            "s_per_board": took["seconds"] / boards,
            "mib_per_board": took["mib"] / boards,
        }
        first = rows[0] if rows else row
        row["time_ratio"] = row["s_per_board"] / first["s_per_board"]
        row["memory_ratio"] = row["mib_per_board"] / first["mib_per_board"]
        rows.append(row)
    print_result("scale", rows, as_json=given.json)


if __name__ == "__main__":
    main()
