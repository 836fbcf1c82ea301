"""How fast virtual time runs: the three mappings of the round-trip experiment, 1000 requests per client.

Goals: at least 300 times faster than the board time that is covered, and at least half the event rate of
bare SimPy. The rival is the same closed loops written with SimPy's own resources, stores and processes: four
clients that ask and a timer, the same stages and waits per message, no computation and no serialisation.
Events are counted in runs of their own, so that counting takes no time from those that are timed.

As in the experiment, the three mappings of a round share the inputs and what was computed of them. Every
round has a seed, and thus inputs, of its own; only the 200 digits are the same in all.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import simpy
from table import arguments, print_result

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.experiment import MAPPINGS
from reconros_zenoh.experiments.roundtrip import CLIENTS, application
from reconros_zenoh.experiments.roundtrip_virtual import add_board_and_clients
from reconros_zenoh.experiments.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    Process = Generator[simpy.Event, Any, None]

ASKERS = len(CLIENTS) - 1
CORES = 2
TIMER_NS = 250_000_000
CORE_STAGES_NS = (200_000, 50_000)
"""The DDS stack takes a message in; the worker is told of it."""
HARDWARE_STAGES_NS = (100_000, 2_000_000, 100_000)
"""MEMIF read, computation, MEMIF write."""
LINK_NS = 300_000


def ours(mapping: str, requests: int, seed: int) -> int:
    """Run the experiment under one mapping and return the board time that it covers [ns]."""
    profile, path = read_profile("miniitx-zynq7100"), application().mapping_path(mapping)
    with Simulation(application().types()) as simulation:
        add_board_and_clients(simulation, profile, path, requests, seed, lambda *_: None)
        simulation.run()
        return simulation.environment.now


class Bare:
    """The rival: one board and its clients."""

    def __init__(self) -> None:
        self.environment = simpy.Environment(0)
        self._cores = simpy.Resource(self.environment, CORES)
        self._memif = simpy.Resource(self.environment, 1)

    def run(self, requests: int) -> int:
        """Make the round trips and return the time that they cover [ns]."""
        clients = []
        for client in (*[self._ask] * ASKERS, self._tick):
            inbox, outbox = simpy.Store(self.environment), simpy.Store(self.environment)
            self.environment.process(self._work(inbox, outbox))
            clients.append(self.environment.process(client(requests, inbox, outbox)))
        self.environment.run(until=self.environment.all_of(clients))
        return int(self.environment.now)

    def _ask(self, requests: int, inbox: simpy.Store, outbox: simpy.Store) -> Process:
        for index in range(requests):
            yield self.environment.timeout(LINK_NS)
            for stage_ns in CORE_STAGES_NS:
                yield from self._use(self._cores, stage_ns)
            yield inbox.put(index)
            yield outbox.get()

    def _tick(self, requests: int, inbox: simpy.Store, outbox: simpy.Store) -> Process:
        for index in range(requests):
            yield self.environment.timeout(TIMER_NS)
            yield inbox.put(index)
            yield outbox.get()

    def _work(self, inbox: simpy.Store, outbox: simpy.Store) -> Process:
        read_ns, compute_ns, write_ns = HARDWARE_STAGES_NS
        while True:
            message = yield inbox.get()
            yield from self._use(self._memif, read_ns)
            yield self.environment.timeout(compute_ns)
            yield from self._use(self._memif, write_ns)
            for stage_ns in reversed(CORE_STAGES_NS):
                yield from self._use(self._cores, stage_ns)
            yield self.environment.timeout(LINK_NS)
            yield outbox.put(message)

    def _use(self, resource: simpy.Resource, time_ns: int) -> Process:
        with resource.request() as granted:
            yield granted
            yield self.environment.timeout(time_ns)


def bare(requests: int) -> int:
    """Run the rival and return the time that it covers [ns]."""
    return Bare().run(requests)


def timed(function: Callable[..., int], *given: object) -> tuple[float, int]:
    """Return how long a run took [s] and the time that it covers [ns]."""
    started = time.perf_counter()
    covered_ns = function(*given)
    return time.perf_counter() - started, covered_ns


def events(function: Callable[..., int], *given: object) -> int:
    """Return how many events a run processes."""
    count = 0
    step = simpy.Environment.step

    def counted(environment: simpy.Environment) -> None:
        nonlocal count
        count += 1
        step(environment)

    with patch.object(simpy.Environment, "step", counted):
        function(*given)
    return count


def main() -> None:
    """Run the benchmark."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--requests", type=int, default=1000, help="requests per client")
    parser.add_argument("--rounds", type=int, default=5, help="how often each side runs, in turn")
    given = parser.parse_args()
    bare_events = events(bare, given.requests)
    rounds: dict[str, list[dict[str, Any]]] = {mapping: [] for mapping in (*MAPPINGS, "all")}
    for seed in range(given.rounds):
        for mapping in MAPPINGS:
            our_s, covered_ns = timed(ours, mapping, given.requests, seed)
            bare_s, _ = timed(bare, given.requests)
            our_events = events(ours, mapping, given.requests, seed)
            ratio = (our_events / our_s) / (bare_events / bare_s)
            rounds[mapping].append(row(mapping, covered_ns / 1e9, our_s, our_events, ratio))
        mappings = [rounds[mapping][-1] for mapping in MAPPINGS]
        totals = {key: sum(row[key] for row in mappings) for key in ("board_s", "s", "events")}
        ratio = totals["events"] / sum(row["events"] / row["rate_ratio"] for row in mappings)
        rounds["all"].append(row("all", totals["board_s"], totals["s"], totals["events"], ratio))
    print_result("engine", [median(rows) for rows in rounds.values()], as_json=given.json)


def median(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the round with the median speed, and how much the rounds differ."""
    speeds = sorted(row["speed"] for row in rows)
    middle = next(row for row in rows if row["speed"] == speeds[len(speeds) // 2])
    return {**middle, "speed_min": speeds[0], "speed_max": speeds[-1]}


def row(mapping: str, board_s: float, took_s: float, processed: int, rate_ratio: float) -> dict[str, Any]:
    """Return a row of the result; `rate_ratio` is our event rate over that of bare SimPy."""
    return {
        "mapping": mapping,
        "board_s": board_s,
        "s": took_s,
        "speed": board_s / took_s,
        "events": processed,
        "events_per_s": processed / took_s,
        "rate_ratio": rate_ratio,
    }


if __name__ == "__main__":
    main()
