"""The cost model meets the text of Mapping and Optimizing, Section 4, and decides by it."""

from __future__ import annotations

from dataclasses import astuple, fields
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mapped_graphs import graphs

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.errors import UsageError
from reconros_zenoh.mapping.communication import TopicMapping, map_topics
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.mapping.predict import (
    LARGEST,
    SMALLEST,
    Predictions,
    TransferCosts,
    forecast,
    memif_load,
    predict_topic,
    transfer_times,
)

if TYPE_CHECKING:
    from pathlib import Path

BYTES_PER_NS = 0.346
UNIT_NS = 10_000 / BYTES_PER_NS
ZCU104 = TransferCosts(
    publish_ns=6.12 * UNIT_NS,
    notify_hardware_ns=0.25 * UNIT_NS,
    notify_software_ns=0.221 * UNIT_NS,
    copy_in_ns_per_byte=1.509 / BYTES_PER_NS,
    copy_out_ns_per_byte=0.266 / BYTES_PER_NS,
    cancel_ns=7.87 * UNIT_NS,
    hmt_overhead_ns=7.31 * UNIT_NS,
    hmt_bytes_per_ns=BYTES_PER_NS,
    memif_bytes_per_ns=BYTES_PER_NS,
)
SIZES = (10_000, 100_000, 1_000_000, 10_000_000)
READERS = (2, 4, 8)
SOFTWARE, HARDWARE, GATEWAY = TopicMapping


def speedups(publisher: Side, size: int, readers: int) -> tuple[float, float]:
    """Return how much faster the gateway is: to the slowest subscriber in hardware, to that in software."""
    smt, gateway = (
        transfer_times(ZCU104, mapping, publisher, size, readers) for mapping in (SOFTWARE, GATEWAY)
    )
    return smt.hardware_ns / gateway.hardware_ns, smt.software_ns / gateway.software_ns


def test_the_speedups_of_the_text() -> None:
    assert speedups(Side.HARDWARE, 10_000, 8)[0] == pytest.approx(1.94, rel=0.01)
    assert speedups(Side.HARDWARE, 10_000_000, 8)[0] == pytest.approx(7.95, rel=0.01)
    assert speedups(Side.HARDWARE, 10_000, 2)[1] == pytest.approx(0.5, rel=0.01)
    assert speedups(Side.HARDWARE, 10_000_000, 8)[1] == pytest.approx(1, rel=0.01)
    assert speedups(Side.SOFTWARE, 10_000, 2)[0] < 1
    largest = max(speedups(Side.SOFTWARE, size, readers)[0] for size in SIZES for readers in READERS)
    assert largest == pytest.approx(3.79, rel=0.01)
    to_software = [speedups(Side.SOFTWARE, size, readers)[1] for size in SIZES for readers in READERS]
    assert min(to_software) == pytest.approx(1.06, rel=0.02)
    assert max(to_software) == pytest.approx(2.05, rel=0.01)


def test_gateway_and_stream_work_at_the_pace_of_the_slower_one() -> None:
    fast_stream = TransferCosts(0, 0, 0, 0, 0, 0, 0, hmt_bytes_per_ns=4, memif_bytes_per_ns=1)
    assert transfer_times(fast_stream, GATEWAY, Side.HARDWARE, 100, 2) == (25, 100)
    assert transfer_times(fast_stream, GATEWAY, Side.SOFTWARE, 100, 2) == (100, 0)


def test_the_costs_of_a_profile(profile_file: Path) -> None:
    profile = read_profile(str(profile_file))
    costs = TransferCosts.of(profile)
    for field in fields(TransferCosts):
        assert getattr(costs, field.name) == pytest.approx(getattr(ZCU104, field.name), rel=1e-3), field.name


@pytest.mark.parametrize("name", ["native", "miniitx-zynq7100"])
def test_a_profile_without_transfer_times(name: str) -> None:
    with pytest.raises(UsageError, match=rf"profile '{name}' has no transfer times of topics"):
        TransferCosts.of(read_profile(name))


def graph_of(
    publishers: str, subscribers: str, size: int | None, rate: float | None = None
) -> ComputationGraph:
    """Return a graph of one topic A; nodes h, i, j, k are in hardware, s, t in software."""
    nodes = dict.fromkeys("hijk", Side.HARDWARE) | dict.fromkeys("st", Side.SOFTWARE)
    return ComputationGraph(nodes, (Topic("A", tuple(publishers), tuple(subscribers), size, rate),))


def test_the_forecast_of_a_topic_with_one_publisher() -> None:
    graph = graph_of("h", "ijs", 10_000)
    # In units of u0, by the formulas: 6.12 + 2 (0.25 + 1) to hardware, 6.12 + 2 x 0.25 + 1 to software.
    smt = forecast(graph, ZCU104, graph.topics[0], 10_000, SOFTWARE)
    assert astuple(smt) == pytest.approx((8.62 * UNIT_NS, 7.62 * UNIT_NS, (2 * 8.62 + 7.62) / 3 * UNIT_NS))
    gateway = forecast(graph, ZCU104, graph.topics[0], 10_000, GATEWAY)
    assert astuple(gateway) == pytest.approx(
        (8.31 * UNIT_NS, 15.24 * UNIT_NS, (2 * 8.31 + 15.24) / 3 * UNIT_NS)
    )


def test_a_forecast_takes_the_slowest_publisher_and_the_mean_of_all() -> None:
    graph, alone = graph_of("hs", "ij", 10_000), graph_of("s", "ij", 10_000)
    both, one = (forecast(each, ZCU104, each.topics[0], 10_000, SOFTWARE) for each in (graph, alone))
    assert (both.hardware_ns, both.software_ns) == (one.hardware_ns, None)
    assert both.mean_ns == pytest.approx((8.62 + 8.62 + 1.509) / 2 * UNIT_NS)


def predict(graph: ComputationGraph, profile_file: Path) -> Predictions:
    return Predictions.of(graph, read_profile(str(profile_file)), map_topics(graph))


@pytest.mark.parametrize(
    ("publishers", "subscribers", "changeover"),
    [
        # Where (2 (6.62 + 2 u) + 6.62 + u) / 3 equals (2 (7.31 + u) + 14.24 + u) / 3, in units of 10 kB.
        ("h", "ijs", 45_000),
        # Where 2 (0.25 + u) equals 0.25 + 7.31 + u.
        ("s", "hi", 70_600),
    ],
)
def test_small_messages_go_through_memory_and_large_ones_through_a_gateway(
    publishers: str, subscribers: str, changeover: int, profile_file: Path
) -> None:
    for size, mapping in ((changeover * 99 // 100, SOFTWARE), (changeover * 101 // 100, GATEWAY)):
        predictions = predict(graph_of(publishers, subscribers, size), profile_file)
        assert predictions.mappings == {"A": mapping}
        prediction = predictions.topics["A"]
        assert prediction.changeover is not None
        assert prediction.changeover.size == pytest.approx(changeover, rel=0.01)
        assert prediction.changeover.mapping is GATEWAY
        assert f"at {size} B" in prediction.decision.reason


def test_one_subscriber_in_hardware_never_pays_for_a_gateway(profile_file: Path) -> None:
    prediction = predict(graph_of("s", "h", LARGEST), profile_file).topics["A"]
    assert (prediction.decision.mapping, prediction.changeover) == (SOFTWARE, None)


def test_without_a_size_the_rule_decides_and_the_changeover_is_told(profile_file: Path) -> None:
    prediction = predict(graph_of("h", "ijs", None), profile_file).topics["A"]
    assert prediction.decision.mapping is GATEWAY
    assert "No size is known" in prediction.decision.reason
    assert (prediction.smt, prediction.gateway) == (None, None)
    assert prediction.changeover is not None
    assert prediction.changeover.size == pytest.approx(45_000, rel=0.01)


@pytest.mark.parametrize(
    ("publishers", "subscribers", "mapping"),
    [("h", "ij", HARDWARE), ("s", "t", SOFTWARE), ("hs", "", SOFTWARE)],
)
def test_ends_on_one_side_leave_nothing_to_predict(
    publishers: str, subscribers: str, mapping: TopicMapping, profile_file: Path
) -> None:
    prediction = predict(graph_of(publishers, subscribers, 1000), profile_file).topics["A"]
    assert prediction.decision.mapping is mapping
    assert (prediction.smt, prediction.gateway, prediction.changeover) == (None, None, None)


def faster(graph: ComputationGraph, topic: Topic, size: int) -> TopicMapping:
    smt, gateway = (forecast(graph, ZCU104, topic, size, mapping) for mapping in (SOFTWARE, GATEWAY))
    return GATEWAY if gateway.mean_ns < smt.mean_ns else SOFTWARE


@given(graph=graphs(), data=st.data())
def test_a_topic_changes_over_once_at_most(graph: ComputationGraph, data: st.DataObject) -> None:
    rule = map_topics(graph)
    for topic in graph.topics:
        prediction = predict_topic(graph, ZCU104, topic, rule[topic.name])
        if not topic.subscribers or len({graph.nodes[edge.node] for edge in topic.edges}) == 1:
            assert prediction.changeover is None
        elif prediction.changeover is None:
            sizes = [SMALLEST, LARGEST, data.draw(st.integers(SMALLEST, LARGEST))]
            assert len({faster(graph, topic, size) for size in sizes}) == 1
        else:
            size, mapping = prediction.changeover
            below, above = data.draw(st.integers(SMALLEST, size - 1)), data.draw(st.integers(size, LARGEST))
            assert faster(graph, topic, below) is not mapping
            assert faster(graph, topic, above) is mapping


@pytest.mark.parametrize(
    ("publishers", "subscribers", "transfers"),
    [
        ("s", "t", (0, None)),
        ("h", "ij", (3, None)),
        ("h", "s", (1, 1)),
        ("s", "hij", (3, 1)),
        ("hs", "ij", (2.5, 1)),
    ],
)
def test_the_load_of_the_memif(
    publishers: str, subscribers: str, transfers: tuple[float, float | None]
) -> None:
    size, rate = 1_000_000, 34.6  # a tenth of the bandwidth
    graph = graph_of(publishers, subscribers, size, rate)
    assert memif_load(graph, ZCU104, {"A": SOFTWARE}) == pytest.approx(transfers[0] / 10)
    if transfers[1] is not None:
        assert memif_load(graph, ZCU104, {"A": GATEWAY}) == pytest.approx(transfers[1] / 10)
    assert memif_load(graph, ZCU104, {"A": HARDWARE}) == 0


def test_a_load_needs_sizes_and_rates_of_what_crosses() -> None:
    assert memif_load(graph_of("s", "t", None), ZCU104, {"A": SOFTWARE}) == 0
    for size, rate in ((None, 1.0), (1, None)):
        assert memif_load(graph_of("s", "h", size, rate), ZCU104, {"A": SOFTWARE}) is None
