"""ReconROS Executor, Section III-B: each worker's OffsetVector."""

from __future__ import annotations

import pytest
from callbacks_for_tests import AlwaysReady, EventQueue, always_ready, arrive, callback, serve, serve_many

from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.executor.reconros import OffsetVector, ReconrosExecutor
from reconros_zenoh.executor.resource_mask import SOFTWARE

NOT_TIMERS = (CallbackKind.SUB, CallbackKind.SRV, CallbackKind.CLT)


@pytest.mark.parametrize("kind", NOT_TIMERS)
def test_position_is_the_callback_served_last_and_wraps_at_the_end_of_the_list(kind: CallbackKind) -> None:
    offsets = OffsetVector([3] * len(CallbackKind))
    assert offsets.search(kind, 0b111) is None  # Position is initialised with the length of the list
    assert [offsets.search(kind, 0b111) for _ in range(5)] == [0, 1, 2, None, 0]
    assert offsets.search(kind, 0b101) == 2
    assert [offsets.search(kind, 0b011) for _ in range(4)] == [None, 0, 1, None]
    assert [offsets.search(kind, 0) for _ in range(2)] == [None, None]
    assert offsets.search(kind, 0b100) == 2


def test_each_list_has_its_own_position() -> None:
    offsets = OffsetVector([2] * len(CallbackKind))
    assert offsets.search(CallbackKind.SUB, 0b11) is None
    assert [offsets.search(CallbackKind.SUB, 0b11) for _ in range(2)] == [0, 1]
    assert offsets.search(CallbackKind.SRV, 0b11) is None
    assert offsets.search(CallbackKind.SRV, 0b11) == 0
    assert offsets.search(CallbackKind.SUB, 0b11) is None


@pytest.mark.parametrize("kind", NOT_TIMERS)
def test_the_first_search_begins_at_index_0(kind: CallbackKind) -> None:
    executor = ReconrosExecutor()
    always_ready(executor, **{kind.name: "a b c"})
    assert serve_many(executor, 7) == "a b c a b c a"


def test_a_search_starts_behind_the_callback_served_last() -> None:
    executor = ReconrosExecutor()
    a, b, c = (callback(name, CallbackKind.SUB, EventQueue()) for name in "abc")
    for entry in (a, b, c):
        executor.add(entry)
    arrive(executor, b)
    assert serve(executor) == "b"
    for entry in (a, b, c):
        arrive(executor, entry)
    assert serve_many(executor, 4) == "c a b None"


@pytest.mark.parametrize("kind", NOT_TIMERS)
def test_after_a_search_that_found_nothing_every_list_is_served_from_its_beginning(
    kind: CallbackKind,
) -> None:
    executor = ReconrosExecutor()
    a, b = (callback(name, kind, EventQueue("event")) for name in "ab")
    executor.add(a)
    executor.add(b)
    assert serve_many(executor, 3) == "a b None"
    arrive(executor, a)
    assert serve_many(executor, 2) == "a None"
    for entry in (b, a):
        arrive(executor, entry)
    assert serve_many(executor, 3) == "a b None"


def test_lists_are_served_in_the_order_subscribers_service_servers_service_clients() -> None:
    executor = ReconrosExecutor()
    for name in ("CLT", "SRV", "SUB"):
        executor.add(callback(name, CallbackKind[name], EventQueue("event")))
    assert serve_many(executor, 4) == "SUB SRV CLT None"


def test_at_the_end_of_a_list_the_worker_looks_at_the_next_list_before_it_starts_over() -> None:
    executor = ReconrosExecutor()
    always_ready(executor, SUB="s", SRV="v", CLT="c")
    assert serve_many(executor, 18) == "s v s c s v s s v s c s v s s v s c"


@pytest.mark.parametrize("kind", [CallbackKind.SRV, CallbackKind.CLT])
def test_a_callback_behind_a_subscriber_that_is_always_ready_is_served_next_but_one(
    kind: CallbackKind,
) -> None:
    executor = ReconrosExecutor()
    always_ready(executor, SUB="camera")
    rare = callback("rare", kind, EventQueue())
    executor.add(rare)
    for busy_before in range(1, 6):
        serve_many(executor, busy_before)
        arrive(executor, rare)
        assert "rare" in serve_many(executor, 2).split()


def test_each_worker_has_its_own_position() -> None:
    executor = ReconrosExecutor()
    always_ready(executor, SUB="a b c")
    assert serve_many(executor, 2, "first") == "a b"
    assert serve_many(executor, 1, "second") == "a"
    assert serve_many(executor, 2, "first") == "c a"
    assert serve_many(executor, 2, "second") == "b c"


def test_workers_of_one_resource_share_no_position_and_never_the_callback() -> None:
    executor = ReconrosExecutor()
    always_ready(executor, SUB="a b")
    first, second = executor.select("first", SOFTWARE), executor.select("second", SOFTWARE)
    assert first is not None
    assert second is not None
    assert (first.entry.name, second.entry.name) == ("a", "b")
    assert executor.select("third", SOFTWARE) is None


def test_a_timer_in_between_does_not_move_position() -> None:
    executor = ReconrosExecutor()
    always_ready(executor, SUB="a b")
    timer = callback("timer", CallbackKind.TMR, EventQueue())
    executor.add(timer)
    assert serve(executor) == "a"
    arrive(executor, timer)
    assert serve_many(executor, 3) == "timer b a"


def test_a_timer_that_is_always_ready_lets_no_other_callback_run() -> None:
    # The price of timers before everything: the paper gives timers no Position either.
    executor = ReconrosExecutor()
    always_ready(executor, TMR="fast slow", SUB="a")
    assert serve_many(executor, 4) == "fast fast fast fast"


def test_a_slot_and_the_processor_take_turns_at_a_callback_that_runs_on_both() -> None:
    executor = ReconrosExecutor()
    executor.add(callback("both", CallbackKind.SRV, AlwaysReady(), (SOFTWARE, 1)))
    executor.add(callback("slot only", CallbackKind.SRV, AlwaysReady(), (1,)))
    in_slot = executor.select("slot 1", 1)
    assert in_slot is not None
    assert in_slot.entry.name == "both"
    assert executor.select("core", SOFTWARE) is None
    executor.finish(in_slot)
    assert serve(executor, "slot 1", 1) == "slot only"
    assert serve(executor, "core", SOFTWARE) == "both"
