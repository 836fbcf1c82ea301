"""The communication mapping by predicted transfer times, on the board of a profile.

Beyond the paper: Mapping and Optimizing, Section 5, decides by the number of subscribers alone, although its
Section 4 finds that a gateway pays for larger messages only. Times are not rounded to nanoseconds: they are
compared, and never points on a clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import mean
from typing import TYPE_CHECKING, NamedTuple, Self

from reconros_zenoh.errors import UsageError
from reconros_zenoh.mapping.communication import Decision, TopicMapping
from reconros_zenoh.mapping.graph import Side

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.mapping.graph import ComputationGraph, Topic

SMALLEST, LARGEST = 1, 100_000_000
"""The message sizes [bytes] between which a changeover is looked for."""


@dataclass(frozen=True, slots=True)
class TransferCosts:
    """What a message costs on its way, in ns and bytes per ns; the fields stand in profiles as well."""

    publish_ns: float
    notify_hardware_ns: float
    notify_software_ns: float
    copy_in_ns_per_byte: float
    copy_out_ns_per_byte: float
    cancel_ns: float
    hmt_overhead_ns: float
    hmt_bytes_per_ns: float
    memif_bytes_per_ns: float

    @classmethod
    def of(cls, profile: Profile) -> Self:
        """Return the costs of a profile; raise UsageError for one that knows nothing of topics."""
        model = profile.model
        if model is None or model.topics is None or model.gateway is None or model.hmt is None:
            raise UsageError(
                f"profile {profile.name!r} has no transfer times of topics. "
                "Take one with [model.topics], [model.gateway] and [model.hmt]."
            )
        return cls(
            publish_ns=model.topics.publish.ns,
            notify_hardware_ns=model.topics.notify_hardware.ns,
            notify_software_ns=model.topics.notify_software.ns,
            copy_in_ns_per_byte=model.topics.copy_in.ns_per_byte,
            copy_out_ns_per_byte=model.topics.copy_out.ns_per_byte,
            cancel_ns=model.gateway.cancel.ns,
            hmt_overhead_ns=model.hmt.overhead.ns,
            hmt_bytes_per_ns=model.hmt.bandwidth.bytes_per_ns,
            memif_bytes_per_ns=model.memif.bandwidth.bytes_per_ns,
        )


class TransferTimes(NamedTuple):
    """From publisher to subscriber [ns]: to the slowest one in hardware, and to one in software."""

    hardware_ns: float
    software_ns: float


def transfer_times(
    costs: TransferCosts, mapping: TopicMapping, publisher: Side, size: int, readers: int
) -> TransferTimes:
    """Return the times of a message of `size` bytes when `readers` subscribers are in hardware.

    `mapping` is SOFTWARE or GATEWAY. The model meets the text of Mapping and Optimizing, Section 4, where one
    subscriber was in software; more of them are assumed not to slow each other. On the SMT side a gateway is
    one subscriber in hardware, and it passes a message on while it transfers it.
    """
    memif_ns = size / costs.memif_bytes_per_ns
    hmt_ns = size / costs.hmt_bytes_per_ns
    through_ns = max(memif_ns, hmt_ns)
    notify_ns = costs.notify_hardware_ns
    publish_ns = costs.publish_ns
    if publisher is Side.HARDWARE:
        if mapping is TopicMapping.GATEWAY:
            return TransferTimes(
                costs.hmt_overhead_ns + hmt_ns, publish_ns + notify_ns + costs.cancel_ns + through_ns
            )
        return TransferTimes(
            publish_ns + readers * (notify_ns + memif_ns), publish_ns + readers * notify_ns + memif_ns
        )
    publish_ns += size * costs.copy_in_ns_per_byte
    copy_ns = costs.notify_software_ns + size * costs.copy_out_ns_per_byte
    if mapping is TopicMapping.GATEWAY:
        return TransferTimes(
            publish_ns + notify_ns + through_ns + costs.hmt_overhead_ns, publish_ns + copy_ns
        )
    return TransferTimes(publish_ns + readers * (notify_ns + memif_ns), publish_ns + readers * copy_ns)


@dataclass(frozen=True, slots=True)
class Forecast:
    """What a topic takes under one mapping [ns].

    The slowest of its subscribers in hardware and in software, over all publishers, None where there is none,
    and the mean over all pairs of publisher and subscriber: each in hardware counts as the slowest.
    """

    hardware_ns: float | None
    software_ns: float | None
    mean_ns: float


def forecast(
    graph: ComputationGraph, costs: TransferCosts, topic: Topic, size: int, mapping: TopicMapping
) -> Forecast:
    """Return the forecast for messages of `size` bytes on a topic that has a subscriber."""
    readers = len(graph.on(Side.HARDWARE, topic.subscribers))
    others = len(topic.subscribers) - readers
    times = [transfer_times(costs, mapping, graph.nodes[node], size, readers) for node in topic.publishers]
    return Forecast(
        max(each.hardware_ns for each in times) if readers else None,
        max(each.software_ns for each in times) if others else None,
        mean((each.hardware_ns * readers + each.software_ns * others) / (readers + others) for each in times),
    )


class Changeover(NamedTuple):
    """From messages of `size` bytes on, `mapping` is the faster one; below it is the other."""

    size: int
    mapping: TopicMapping


@dataclass(frozen=True, slots=True)
class Prediction:
    """What the model says of one topic.

    `smt` and `gateway` are None without a size, `changeover` where one mapping is the faster one for messages
    of all sizes. A topic with all ends on one side has none of these.
    """

    decision: Decision
    smt: Forecast | None = None
    gateway: Forecast | None = None
    changeover: Changeover | None = None


@dataclass(frozen=True, slots=True)
class Predictions:
    """What a profile says of all topics of a graph; `model` is its name."""

    model: str
    costs: TransferCosts
    topics: dict[str, Prediction]

    @classmethod
    def of(cls, graph: ComputationGraph, profile: Profile, rule: Mapping[str, Decision]) -> Self:
        """Return the predictions of a profile for all topics; raise UsageError as `TransferCosts.of`."""
        costs = TransferCosts.of(profile)
        topics = {topic.name: predict_topic(graph, costs, topic, rule[topic.name]) for topic in graph.topics}
        return cls(profile.name, costs, topics)

    @property
    def mappings(self) -> dict[str, TopicMapping]:
        """The mapping of each topic."""
        return {name: prediction.decision.mapping for name, prediction in self.topics.items()}


def predict_topic(graph: ComputationGraph, costs: TransferCosts, topic: Topic, rule: Decision) -> Prediction:
    """Return the mapping with the smaller mean transfer time, the SMT if both are equal.

    A topic without a size keeps the mapping of `rule`. So does one with all ends on one side: the
    measurements behind the model compare SMT and gateway only.
    """
    if len({graph.nodes[edge.node] for edge in topic.edges}) == 1 or not topic.subscribers:
        return Prediction(rule)

    def compare(size: int) -> tuple[Forecast, Forecast]:
        return (
            forecast(graph, costs, topic, size, TopicMapping.SOFTWARE),
            forecast(graph, costs, topic, size, TopicMapping.GATEWAY),
        )

    changeover = _changeover(lambda size: _faster(*compare(size)))
    if topic.size is None:
        unknown = Decision(rule.mapping, "No size is known, so the rule decides.")
        return Prediction(unknown, changeover=changeover)
    smt, gateway = compare(topic.size)
    reason = (
        f"{smt.mean_ns / 1e6:.3f} ms in software, {gateway.mean_ns / 1e6:.3f} ms with a gateway, "
        f"as a mean at {topic.size} B."
    )
    return Prediction(Decision(_faster(smt, gateway), reason), smt, gateway, changeover)


def _faster(smt: Forecast, gateway: Forecast) -> TopicMapping:
    return TopicMapping.GATEWAY if gateway.mean_ns < smt.mean_ns else TopicMapping.SOFTWARE


def _changeover(faster: Callable[[int], TopicMapping]) -> Changeover | None:
    """Return the changeover between SMALLEST and LARGEST.

    Times grow linearly with the size, so there is one or none.
    """
    low, high = SMALLEST, LARGEST
    if faster(low) is faster(high):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if faster(middle) is faster(SMALLEST):
            low = middle
        else:
            high = middle
    return Changeover(high, faster(high))


def memif_load(
    graph: ComputationGraph, costs: TransferCosts, mappings: Mapping[str, TopicMapping]
) -> float | None:
    """Return the share of the MEMIF bandwidth that the topics take, None where a size or rate is missing.

    The MEMIF carries what nodes in hardware write to an SMT and read from it, and each message of a topic
    with a gateway once.
    """
    load = 0.0
    for topic in graph.topics:
        transfers = _transfers(graph, topic, mappings[topic.name])
        if transfers == 0:
            continue
        if topic.size is None or topic.rate is None:
            return None
        load += transfers * topic.size * topic.rate / (costs.memif_bytes_per_ns * 1e9)
    return load


def _transfers(graph: ComputationGraph, topic: Topic, mapping: TopicMapping) -> float:
    """Return the transfers over the MEMIF per message, as a mean over the publishers."""
    if mapping is not TopicMapping.SOFTWARE:
        return float(mapping is TopicMapping.GATEWAY)
    writers = len(graph.on(Side.HARDWARE, topic.publishers))
    return writers / len(topic.publishers) + len(graph.on(Side.HARDWARE, topic.subscribers))
