"""A callback that is always ready is served again within a bound, whatever the other callbacks do.

Timers do not count: they go before everything under both executors.

ReconrosExecutor. Take one worker, and let n1, n2 and n3 be how many subscribers, service servers and service
clients have a field for its resource. The worker looks at the second list only when it has met the end of the
first, and at the third only when it has met the end of the second: the lists turn like wheels of a counter.
A callback of list k is served at the latest when list k is looked at for the (nk + 1)th time: the worker may
first serve everything behind the callback, wrap, and serve everything before it. For each of these looks, the
list in front of list k is looked at n + 1 times, n times with success. Of the later lists one callback is
served at the most, namely when list k wraps. Together: the callback is the

    (n1 + 1) * ... * (nk + 1) - 1 + (1 if a later list holds anything)

-th at the latest that the worker serves from the moment at which it could start. That holds for each worker
by itself, whatever the others do: they can only take callbacks away from it.

StandardExecutor. All workers together serve one readySet. The callback may have become ready just after a
readySet of all n - 1 others was collected, whose first was served at once: n - 2 are left. It is in the next
readySet, behind n - 1 others at the most. So it is the (2n - 2)th at the latest that they serve.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import TYPE_CHECKING

import pytest
from callbacks_for_tests import AlwaysReady, EventQueue, always_ready, arrive, callback, serve_many
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.executor.callbacks import CallbackEntry, CallbackKind
from reconros_zenoh.executor.reconros import ReconrosExecutor
from reconros_zenoh.executor.resource_mask import SOFTWARE
from reconros_zenoh.executor.standard import StandardExecutor

if TYPE_CHECKING:
    from reconros_zenoh.executor.callbacks import CallbackLists, Dispatch

NOT_TIMERS = (CallbackKind.SUB, CallbackKind.SRV, CallbackKind.CLT)
ACTIONS = 200


def reconros_bound(watched: CallbackEntry, registered: list[CallbackEntry], resource: int) -> int:
    """Return as which callback a worker of the resource serves the watched one at the latest."""
    lengths = [
        sum(entry.kind is kind and resource in entry.mask for entry in registered) for kind in NOT_TIMERS
    ]
    lists = NOT_TIMERS.index(watched.kind) + 1
    return prod(length + 1 for length in lengths[:lists]) - 1 + any(lengths[lists:])


def standard_bound(registered: list[CallbackEntry]) -> int:
    """Return as which callback of all workers any one is served at the latest."""
    return max(1, 2 * sum(entry.kind is not CallbackKind.TMR for entry in registered) - 2)


@dataclass(eq=False)
class Worker:
    """A worker, what it runs, and how many callbacks it was given while the watched one could start."""

    resource: int
    running: Dispatch | None = None
    passed: int = 0


class Crowd:
    """Workers that serve the watched callback, always ready, among others with events at random times."""

    def __init__(
        self,
        executor: CallbackLists,
        watched: CallbackEntry,
        others: list[CallbackEntry],
        place: int,
        resources: list[int],
    ) -> None:
        self.executor = executor
        self.watched = watched
        self.registered = [*others[:place], watched, *others[place:]]
        self.workers = [Worker(resource) for resource in resources]
        self._queues = [entry for entry in others if isinstance(entry.source, EventQueue)]
        for entry in self.registered:
            executor.add(entry)

    def act(self, choose: random.Random) -> None:
        """Let one event come, or one worker select or finish."""
        if self._queues and choose.random() < 0.4:
            arrive(self.executor, choose.choice(self._queues))
            return
        worker = choose.choice(self.workers)
        if worker.running is not None:
            self.executor.finish(worker.running)
            worker.running = None
        else:
            self._select(worker)

    def _select(self, worker: Worker) -> None:
        could_start = not self.watched.running and worker.resource in self.watched.mask
        worker.running = self.executor.select(worker, worker.resource)
        if worker.running is None:
            assert not could_start
        elif worker.running.entry is self.watched:
            for each in self.workers:
                each.passed = 0
        elif worker.running.entry.kind is not CallbackKind.TMR and not self.watched.running:
            worker.passed += 1


def entries(resources: st.SearchStrategy[list[int]]) -> st.SearchStrategy[list[CallbackEntry]]:
    """Return lists of callbacks on some of the resources; some are always ready, but no timer is."""

    def named(drawn: list[tuple[CallbackKind, list[int], bool]]) -> list[CallbackEntry]:
        return [
            callback(f"{number}", kind, AlwaysReady() if always else EventQueue(), where)
            for number, (kind, where, always) in enumerate(drawn)
        ]

    timers = st.tuples(st.just(CallbackKind.TMR), resources, st.just(value=False))
    rest = st.tuples(st.sampled_from(NOT_TIMERS), resources, st.booleans())
    return st.lists(timers | rest, max_size=6).map(named)


kinds = st.sampled_from(NOT_TIMERS)
places = st.integers(0, 6)
masks = st.lists(st.integers(SOFTWARE, 2), min_size=1, max_size=4, unique=True)
seeds = st.integers(0, 2**32)
crews = st.lists(st.integers(SOFTWARE, 2), min_size=1, max_size=5)


@given(entries(masks), kinds, masks, places, crews, seeds)
def test_each_reconros_worker_serves_a_callback_that_is_always_ready_within_the_bound(
    others: list[CallbackEntry],
    kind: CallbackKind,
    mask: list[int],
    place: int,
    resources: list[int],
    seed: int,
) -> None:
    watched = callback("watched", kind, AlwaysReady(), mask)
    crowd = Crowd(ReconrosExecutor(), watched, others, place, resources)
    bounds = {resource: reconros_bound(watched, crowd.registered, resource) for resource in mask}
    choose = random.Random(seed)
    for _ in range(ACTIONS):
        crowd.act(choose)
        for worker in crowd.workers:
            assert worker.resource not in bounds or worker.passed < bounds[worker.resource]


@given(entries(st.just([SOFTWARE])), kinds, places, st.integers(1, 4), seeds)
def test_standard_workers_serve_a_callback_that_is_always_ready_within_the_bound(
    others: list[CallbackEntry], kind: CallbackKind, place: int, workers: int, seed: int
) -> None:
    watched = callback("watched", kind, AlwaysReady())
    crowd = Crowd(StandardExecutor(), watched, others, place, [SOFTWARE] * workers)
    bound = standard_bound(crowd.registered)
    choose = random.Random(seed)
    for _ in range(ACTIONS):
        crowd.act(choose)
        assert sum(worker.passed for worker in crowd.workers) < bound


@pytest.mark.parametrize("kind", NOT_TIMERS)
@pytest.mark.parametrize("lengths", [(1, 1, 1), (3, 1, 1), (1, 3, 2), (2, 2, 2), (1, 4, 1), (2, 1, 4)])
def test_the_reconros_bound_is_reached_when_every_callback_is_always_ready(
    lengths: tuple[int, int, int], kind: CallbackKind
) -> None:
    executor = ReconrosExecutor()
    always_ready(
        executor,
        **{
            each.name: " ".join(f"{each.name}{number}" for number in range(length))
            for each, length in zip(NOT_TIMERS, lengths, strict=True)
        },
    )
    registered = list(executor)
    for watched in [entry for entry in executor if entry.kind is kind]:
        bound = reconros_bound(watched, registered, SOFTWARE)
        served = serve_many(executor, 20 * bound).split()
        turns = [turn for turn, name in enumerate(served) if name == watched.name]
        assert max(after - before for before, after in pairwise(turns)) == bound


def test_the_standard_bound_is_reached_by_a_long_callback_that_misses_a_ready_set() -> None:
    executor = StandardExecutor()
    always_ready(executor, SUB="a b c", CLT="long")
    assert serve_many(executor, 3) == "a b c"
    long = executor.select("first", SOFTWARE)
    assert long is not None
    assert serve_many(executor, 1, "second") == "a"  # collects a, b and c
    executor.finish(long)
    assert serve_many(executor, standard_bound(list(executor)), "second") == "b c a b c long"
