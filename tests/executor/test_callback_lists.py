"""The four lists, and what holds for a registered callback under either executor."""

from __future__ import annotations

import pytest
from callbacks_for_tests import AlwaysReady, EventQueue, arrive, callback, implementation, serve

from reconros_zenoh.executor.callbacks import CallbackKind, CallbackLists
from reconros_zenoh.executor.reconros import ReconrosExecutor
from reconros_zenoh.executor.resource_mask import SOFTWARE
from reconros_zenoh.executor.standard import StandardExecutor


@pytest.fixture(params=[ReconrosExecutor, StandardExecutor])
def executor(request: pytest.FixtureRequest) -> CallbackLists:
    made: CallbackLists = request.param()
    return made


def test_the_lists_stand_in_the_order_of_kinds_each_in_the_order_of_registration(
    executor: CallbackLists,
) -> None:
    for name in ("CLT b", "SUB b", "TMR b", "SRV b", "SUB a", "TMR a", "CLT a", "SRV a"):
        executor.add(callback(name, CallbackKind[name[:3]], EventQueue()))
    names = [entry.name for entry in executor]
    assert names == ["TMR b", "TMR a", "SUB b", "SUB a", "SRV b", "SRV a", "CLT b", "CLT a"]
    assert [entry.index for entry in executor] == [0, 1] * len(CallbackKind)


@pytest.mark.parametrize("kind", CallbackKind)
def test_a_name_is_registered_once_whatever_the_kind(executor: CallbackLists, kind: CallbackKind) -> None:
    first = callback("sort", CallbackKind.SRV, EventQueue())
    executor.add(first)
    with pytest.raises(ValueError, match="a callback named 'sort' is registered already"):
        executor.add(callback("sort", kind, AlwaysReady()))
    assert list(executor) == [first]
    assert serve(executor) is None


@pytest.mark.parametrize("kind", CallbackKind)
def test_a_worker_takes_the_oldest_event_and_the_implementation_for_its_resource(
    executor: CallbackLists, kind: CallbackKind
) -> None:
    entry = callback("a", kind, EventQueue("old", "new"), (SOFTWARE, 0, 1))
    executor.add(entry)
    for event in ("old", "new"):
        dispatch = executor.select("worker", SOFTWARE)
        assert dispatch is not None
        assert (dispatch.entry, dispatch.message) == (entry, event)
        assert dispatch.implementation == implementation("a", SOFTWARE)
        executor.finish(dispatch)
    assert executor.select("worker", SOFTWARE) is None


@pytest.mark.parametrize("kind", CallbackKind)
def test_a_callback_that_runs_is_not_started_again_until_it_has_finished(
    executor: CallbackLists, kind: CallbackKind
) -> None:
    executor.add(callback("a", kind, AlwaysReady()))
    running = executor.select("first", SOFTWARE)
    assert running is not None
    assert executor.select("second", SOFTWARE) is None
    executor.finish(running)
    assert serve(executor, "second") == "a"


@pytest.mark.parametrize("kind", CallbackKind)
def test_an_event_that_comes_while_the_callback_runs_waits_until_it_has_finished(
    executor: CallbackLists, kind: CallbackKind
) -> None:
    entry = callback("a", kind, EventQueue("first"))
    executor.add(entry)
    running = executor.select("first", SOFTWARE)
    assert running is not None
    arrive(executor, entry, "second")
    assert executor.select("second", SOFTWARE) is None
    executor.finish(running)
    dispatch = executor.select("second", SOFTWARE)
    assert dispatch is not None
    assert dispatch.message == "second"


@pytest.mark.parametrize("kind", CallbackKind)
@pytest.mark.parametrize("is_told", [False, True])
def test_a_callback_is_not_started_twice_while_its_event_is_taken(
    executor: CallbackLists, kind: CallbackKind, is_told: bool
) -> None:
    class Stream(EventQueue):
        """Lets others go on as soon as an event is taken: with the next one, or with what else they do."""

        def take(self) -> object:
            event = super().take()
            if is_told:
                executor.refresh(entry)
            others.append(executor.select("second", SOFTWARE))
            return event

    others: list[object] = []
    entry = callback("a", kind, Stream("first", "next"))
    executor.add(entry)
    dispatch = executor.select("first", SOFTWARE)
    assert dispatch is not None
    assert (dispatch.message, others) == ("first", [None])
    executor.finish(dispatch)
    assert serve(executor, "second") == "a"


@pytest.mark.parametrize("kind", CallbackKind)
def test_a_worker_gets_nothing_that_its_field_of_the_mask_does_not_hold(
    executor: CallbackLists, kind: CallbackKind
) -> None:
    executor.add(callback("hardware", kind, AlwaysReady(), (0, 2)))
    assert executor.select("software worker", SOFTWARE) is None
    assert executor.select("worker of slot 1", 1) is None
    assert serve(executor, "worker of slot 2", 2) == "hardware"


@pytest.mark.parametrize("kind", CallbackKind)
def test_an_event_that_has_gone_is_not_served(executor: CallbackLists, kind: CallbackKind) -> None:
    source = EventQueue("event")
    entry = callback("a", kind, source)
    executor.add(entry)
    source.events.clear()
    executor.refresh(entry)
    assert executor.select("worker", SOFTWARE) is None


def test_timers_are_served_first_and_the_one_registered_first_before_the_others(
    executor: CallbackLists,
) -> None:
    first, second = (callback(f"timer {number}", CallbackKind.TMR, EventQueue()) for number in (1, 2))
    executor.add(callback("subscriber", CallbackKind.SUB, AlwaysReady()))
    executor.add(first)
    executor.add(second)
    assert serve(executor) == "subscriber"
    arrive(executor, second)
    assert serve(executor) == "timer 2"
    arrive(executor, second)
    arrive(executor, first)
    arrive(executor, first)
    assert [serve(executor) for _ in range(4)] == ["timer 1", "timer 1", "timer 2", "subscriber"]


def test_hundreds_of_callbacks_are_served_in_the_order_of_registration(executor: CallbackLists) -> None:
    names = [f"{number}" for number in range(300)]
    for name in names:
        executor.add(callback(name, CallbackKind.SUB, AlwaysReady()))
    assert [serve(executor) for _ in range(600)] == names * 2
