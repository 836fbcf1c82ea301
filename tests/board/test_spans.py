"""Timelines: their stages have no gap, and a published message has the past of the one it answers."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.board.spans import Spans, Timeline
from reconros_zenoh.clock.virtual import VirtualEnvironment


def test_a_mark_accounts_for_the_time_since_the_last_one() -> None:
    environment = VirtualEnvironment()
    environment.run(until=1000)
    timeline = Timeline(environment, started_ns=400)
    timeline.mark("transport")
    environment.run(until=1250)
    timeline.mark("dds")
    timeline.mark("queue")
    assert timeline.stages_ns == {"transport": 600, "dds": 250, "queue": 0}
    assert timeline.age_ns == 850


def test_a_stage_that_comes_twice_adds_up() -> None:
    environment = VirtualEnvironment()
    timeline = Timeline(environment, 0)
    for stop_ns, stage in [(10, "dds"), (30, "execution"), (70, "dds")]:
        environment.run(until=stop_ns)
        timeline.mark(stage)  # type: ignore[arg-type] # mypy widens the literals of a list
    assert timeline.stages_ns == {"dds": 50, "execution": 20}


@given(
    st.lists(st.tuples(st.integers(0, 1000), st.sampled_from(["dds", "queue", "memif"]), st.booleans())),
    st.integers(0, 10_000),
)
def test_the_stages_always_sum_to_the_time_since_the_start(
    steps: list[tuple[int, str, bool]], started_ns: int
) -> None:
    environment = VirtualEnvironment(started_ns)
    timeline = Timeline(environment, started_ns)
    for pause_ns, stage, fork in steps:
        environment.run(until=environment.now + pause_ns) if pause_ns else None
        timeline.mark(stage)  # type: ignore[arg-type] # one of three stages
        timeline = timeline.fork() if fork else timeline
        assert timeline.age_ns == sum(timeline.stages_ns.values()) == environment.now - started_ns


def test_a_fork_shares_the_past_and_nothing_after() -> None:
    environment = VirtualEnvironment()
    timeline = Timeline(environment, 0)
    timeline.callback = "sobel"
    environment.run(until=10)
    timeline.mark("execution")
    other = timeline.fork()
    environment.run(until=25)
    other.mark("dds")
    assert other.callback == "sobel"
    assert other.stages_ns == {"execution": 10, "dds": 15}
    assert timeline.stages_ns == {"execution": 10}


def test_means_per_message_by_callback() -> None:
    environment = VirtualEnvironment()
    spans = Spans()
    for callback, end_ns in [("a", 1_000_000), ("b", 2_000_000), ("a", 5_000_000)]:
        timeline = Timeline(environment, environment.now)
        timeline.callback = callback
        environment.run(until=end_ns)
        timeline.mark("execution")
        spans.add(timeline)
    assert spans.mean_ms() == {"a": {"execution": 2.0}, "b": {"execution": 1.0}}


def test_a_stage_that_not_every_message_has_counts_as_nothing_for_the_others() -> None:
    environment = VirtualEnvironment()
    spans = Spans()
    spans.add(Timeline(environment, 0))
    environment.run(until=3_000_000)
    late = Timeline(environment, 0)
    late.mark("retransmission")
    spans.add(late)
    assert spans.mean_ms() == {"": {"retransmission": 1.5}}
