"""One client run as a command: records, a line of result, and the exit status."""

from __future__ import annotations

import json
from contextlib import nullcontext
from typing import TYPE_CHECKING

from host_clients.daemon import run_client
from reconros_zenoh.measure.record import Record, RecordWriter
from reconros_zenoh.measure.statistics import format_ms, summarise

if TYPE_CHECKING:
    from pathlib import Path

    from host_clients.daemon import ClientOptions
    from reconros_zenoh.measure.record import RoundTrip


def make_round_trips(router: str, options: ClientOptions, out: Path | None, *, as_json: bool) -> int:
    """Run the client, print what came out, and return the exit status.

    0: all requests were answered rightly; 1: one was lost or answered wrongly; 130: ended by a signal before.
    """
    round_trips: list[RoundTrip] = []
    with RecordWriter(out) if out else nullcontext() as writer:

        def record(round_trip: RoundTrip) -> None:
            round_trips.append(round_trip)
            if writer:
                writer.write(round_trip)

        complete = run_client(router, options, record)
    made = Record.of(options.name, round_trips)
    summary = summarise(made.values_ms, made.lost, made.wrong)
    if as_json:
        print(json.dumps({"client": options.name, "requests": options.requests, **summary}))
    else:
        print(
            f"{options.name}: {summary['n']} answers, {made.lost} lost, {made.wrong} wrong, "
            f"median {format_ms(summary['median_ms'])} ms, p99 {format_ms(summary['p99_ms'])} ms",
            flush=True,
        )
    if not complete:
        return 130
    return 1 if made.lost or made.wrong else 0
