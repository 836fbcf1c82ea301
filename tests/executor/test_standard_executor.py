"""ReconROS Executor, Section II-B, Fig. 2: the readySet of the executor of ROS 2."""

from __future__ import annotations

from callbacks_for_tests import AlwaysReady, EventQueue, always_ready, arrive, callback, serve, serve_many

from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.executor.resource_mask import SOFTWARE
from reconros_zenoh.executor.standard import StandardExecutor


def test_a_ready_set_is_served_by_kind_and_within_a_kind_by_registration() -> None:
    executor = StandardExecutor()
    always_ready(executor, CLT="c d", SRV="v w", SUB="s t")
    assert serve_many(executor, 12) == "s t v w c d s t v w c d"


def test_an_event_that_comes_while_a_ready_set_is_served_waits_for_the_next() -> None:
    executor = StandardExecutor()
    a, b = (callback(name, CallbackKind.SUB, EventQueue()) for name in "ab")
    server = callback("server", CallbackKind.SRV, EventQueue())
    for entry in (a, b, server):
        executor.add(entry)
    arrive(executor, b)
    arrive(executor, server)
    assert serve(executor) == "b"
    arrive(executor, a)  # before the server in order, but not in its readySet
    arrive(executor, b)
    assert serve_many(executor, 4) == "server a b None"


def test_a_callback_is_served_once_per_ready_set_however_many_events_wait() -> None:
    executor = StandardExecutor()
    executor.add(callback("burst", CallbackKind.SUB, EventQueue(1, 2, 3)))
    executor.add(callback("server", CallbackKind.SRV, EventQueue(1, 2)))
    assert serve_many(executor, 6) == "burst server burst server burst None"


def test_timers_go_before_what_a_ready_set_still_holds() -> None:
    executor = StandardExecutor()
    always_ready(executor, SUB="a b")
    timer = callback("timer", CallbackKind.TMR, EventQueue())
    executor.add(timer)
    assert serve(executor) == "a"
    arrive(executor, timer)
    arrive(executor, timer)
    assert serve_many(executor, 4) == "timer timer b a"


def test_a_timer_is_no_part_of_a_ready_set() -> None:
    executor = StandardExecutor()
    timer = callback("timer", CallbackKind.TMR, EventQueue("event"))
    executor.add(timer)
    always_ready(executor, SUB="a")
    assert serve_many(executor, 3) == "timer a a"


def test_all_workers_share_the_one_ready_set() -> None:
    executor = StandardExecutor()
    always_ready(executor, SUB="a b c")
    order = [serve_many(executor, 1, worker) for worker in ("first", "second", "first", "second")]
    assert order == ["a", "b", "c", "a"]


def test_a_callback_that_runs_while_a_ready_set_is_collected_waits_for_the_next() -> None:
    executor = StandardExecutor()
    always_ready(executor, SUB="a b c")
    long = executor.select("first", SOFTWARE)
    assert long is not None
    assert long.entry.name == "a"
    assert serve_many(executor, 3, "second") == "b c b"  # the second b: a new readySet, without a
    executor.finish(long)
    assert serve_many(executor, 3, "second") == "c a b"


def test_a_new_ready_set_is_collected_although_a_callback_still_runs() -> None:
    executor = StandardExecutor()
    always_ready(executor, SUB="a b")
    assert executor.select("first", SOFTWARE) is not None
    assert serve_many(executor, 3, "second") == "b b b"


def test_an_event_that_has_gone_from_a_ready_set_is_passed_over() -> None:
    executor = StandardExecutor()
    always_ready(executor, SUB="a", CLT="c")
    source = EventQueue("event")
    server = callback("server", CallbackKind.SRV, source)
    executor.add(server)
    assert serve(executor) == "a"
    source.events.clear()
    executor.refresh(server)
    assert serve_many(executor, 2) == "c a"
    arrive(executor, server)  # too late for the readySet that a was served from
    assert serve_many(executor, 3) == "c a server"


def test_nothing_is_collected_while_nothing_is_ready() -> None:
    executor = StandardExecutor()
    executor.add(callback("hardware only", CallbackKind.SUB, AlwaysReady(), (0,)))
    late = callback("late", CallbackKind.SUB, EventQueue())
    executor.add(late)
    assert serve_many(executor, 2) == "None None"
    arrive(executor, late)
    assert serve_many(executor, 2) == "late None"
