"""How late the wall-clock loop of a board is under the demo's load: five clients, all_hardware.

The rival is SimPy's own RealtimeEnvironment with a timer alone on the idle machine: the best case of a loop
that sleeps until each event.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import simpy.rt
from table import arguments, print_result

from reconros_zenoh.cli.experiment import plan, run
from reconros_zenoh.cli.options import ClockName

EVENTS = 2000
PERIOD_S = 0.0025


def sleeping_loop_lags_us() -> list[float]:
    """Return how late SimPy's own real-time loop starts its events [us]."""
    lags = []
    environment = simpy.rt.RealtimeEnvironment(factor=1.0, strict=False)

    def tick() -> Any:
        started, due = time.monotonic(), 0.0
        for _ in range(EVENTS):
            yield environment.timeout(PERIOD_S)
            due += PERIOD_S
            lags.append((time.monotonic() - started - due) * 1e6)

    environment.process(tick())
    environment.sync()
    environment.run()
    return lags


def main() -> None:
    """Run the benchmark."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--requests", type=int, default=60, help="requests per client")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        experiment = run(
            plan(ClockName.WALL, ["all_hardware"], given.requests, 0, Path(folder), "miniitx-zynq7100"),
            quiet=True,
        )
    host = experiment["host"]
    rival = sleeping_loop_lags_us()
    p50, p99 = statistics.median(rival), statistics.quantiles(rival, n=100)[98]
    rows = [
        {"loop": "ours, under the demo's load", "p50_us": host["lag_p50_us"], "p99_us": host["lag_p99_us"]},
        {"loop": "simpy.rt, idle machine", "p50_us": p50, "p99_us": p99},
        {"loop": "ratio", "p50_us": host["lag_p50_us"] / p50, "p99_us": host["lag_p99_us"] / p99},
    ]
    print_result("clock", rows, as_json=given.json)


if __name__ == "__main__":
    main()
