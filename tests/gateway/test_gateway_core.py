"""The gateway core alone: each transition of Fig. 4."""

from __future__ import annotations

import itertools

import pytest

from reconros_zenoh.gateway.core import (
    Arrived,
    Cancel,
    Cancelled,
    Phase,
    Publish,
    Published,
    Request,
    Responded,
    Started,
    State,
    Transferred,
    WriteHmt,
    WriteMemory,
    step,
)
from reconros_zenoh.gateway.filters import Pair, PublisherFilter, conflict

POLLING = State(Phase.POLLING)


def run(state, *events):
    actions = []
    for event in events:
        state, action = step(state, event)
        actions.append(action)
    return state, actions


def test_it_asks_its_delegate_first_of_all() -> None:
    assert run(State(), Started()) == (POLLING, [Request()])


def test_a_message_of_the_smt_goes_to_the_hmt_and_the_next_is_asked_for() -> None:
    assert run(POLLING, Responded("m"), Transferred()) == (POLLING, [WriteHmt("m"), Request()])


def test_a_message_of_the_hmt_is_in_memory_and_the_request_cancelled_before_it_is_published() -> None:
    assert run(POLLING, Arrived("m"), Transferred(), Cancelled(None), Published()) == (
        POLLING,
        [WriteMemory("m"), Cancel(), Publish("m"), Request()],
    )


def test_a_message_between_request_and_cancel_is_forwarded_before_the_next_request() -> None:
    assert run(POLLING, Arrived("out"), Transferred(), Cancelled("in"), Published(), Transferred()) == (
        POLLING,
        [WriteMemory("out"), Cancel(), Publish("out"), WriteHmt("in"), Request()],
    )


AWAITED = {
    Phase.STARTING: {Started},
    Phase.POLLING: {Responded, Arrived},
    Phase.TO_HMT: {Transferred},
    Phase.TO_MEMORY: {Transferred},
    Phase.CANCELLING: {Cancelled},
    Phase.PUBLISHING: {Published},
}
EVENTS = (Started(), Responded("m"), Arrived("m"), Transferred(), Cancelled("m"), Published())


@pytest.mark.parametrize(("phase", "event"), list(itertools.product(Phase, EVENTS)))
def test_each_phase_takes_the_events_that_it_waits_for_and_no_other(phase, event) -> None:
    if type(event) in AWAITED[phase]:
        step(State(phase), event)
    else:
        with pytest.raises(ValueError, match=phase.name):
            step(State(phase), event)


def test_a_filter_discards_what_its_own_publisher_sent() -> None:
    assert [PublisherFilter("a").passes(publisher) for publisher in ("a", "b")] == [False, True]


@pytest.mark.parametrize(
    ("pair", "topic"),
    [
        (Pair("hmt/b/a", "/a"), "hmt/b/a"),
        (Pair("hmt/b/a", "/c"), "hmt/b/a"),
        (Pair("hmt/b/c", "/a"), "/a"),
        (Pair("hmt/b/c", "/c"), None),
    ],
)
def test_a_topic_has_one_gateway(pair, topic) -> None:
    assert conflict(pair, [Pair("hmt/b/x", "/x"), Pair("hmt/b/a", "/a")]) == topic
