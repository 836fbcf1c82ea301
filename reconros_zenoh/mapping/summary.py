"""A communication mapping as one object: what `reconros map --json` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.mapping.communication import Crossings, TopicMapping, crossing_edges, topics_of
from reconros_zenoh.mapping.predict import memif_load

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.mapping.communication import Decision
    from reconros_zenoh.mapping.graph import ComputationGraph, Edge, Topic
    from reconros_zenoh.mapping.predict import Forecast, Prediction, Predictions


def summarise(
    graph: ComputationGraph, rule: Mapping[str, Decision], predictions: Predictions | None
) -> dict[str, Any]:
    """Return the mapping by the rule and, where there are predictions, beside it the one by them.

    Names stay as they are; times are in ms, sizes in bytes, loads shares of the MEMIF bandwidth.
    """
    mappings = {name: decision.mapping for name, decision in rule.items()}
    crossings = Crossings.of(graph, mappings)
    summary: dict[str, Any] = {
        "nodes": dict(graph.nodes),
        **_sets(mappings),
        "crossings": {
            "all_software": len(crossings.all_software),
            "hardware_topics": len(crossings.hardware_topics),
            "gateways": len(crossings.gateways),
        },
        "crossing_edges": [_edge(edge) for edge in crossings.gateways],
        "topics": [_topic(topic, rule[topic.name]) for topic in graph.topics],
        "notes": list(graph.notes),
        "warnings": list(graph.warnings),
    }
    if predictions:
        for topic in summary["topics"]:
            topic["predicted"] = _prediction(predictions.topics[topic["name"]])
        summary["predicted"] = {
            "model": predictions.model,
            **_sets(predictions.mappings),
            "crossings": len(crossing_edges(graph, predictions.mappings)),
            "memif_load": {
                name: memif_load(graph, predictions.costs, loading)
                for name, loading in (
                    ("all_software", dict.fromkeys(rule, TopicMapping.SOFTWARE)),
                    ("rule", mappings),
                    ("predicted", predictions.mappings),
                )
            },
        }
    return summary


def _sets(mappings: Mapping[str, TopicMapping]) -> dict[str, list[str]]:
    return {
        "t_sw": topics_of(mappings, TopicMapping.SOFTWARE),
        "t_hw": topics_of(mappings, TopicMapping.HARDWARE),
        "t_gw": topics_of(mappings, TopicMapping.GATEWAY),
    }


def _edge(edge: Edge) -> dict[str, str]:
    source, target = (edge.node, edge.topic) if edge.publishes else (edge.topic, edge.node)
    return {"from": source, "to": target}


def _topic(topic: Topic, decision: Decision) -> dict[str, Any]:
    return {
        "name": topic.name,
        "mapping": decision.mapping,
        "reason": decision.reason,
        "publishers": topic.publishers,
        "subscribers": topic.subscribers,
        "size": topic.size,
        "rate": topic.rate,
    }


def _prediction(prediction: Prediction) -> dict[str, Any]:
    changeover = prediction.changeover
    return {
        "mapping": prediction.decision.mapping,
        "reason": prediction.decision.reason,
        "smt": _forecast(prediction.smt),
        "gateway": _forecast(prediction.gateway),
        "changeover": changeover and {"bytes": changeover.size, "mapping": changeover.mapping},
    }


def _forecast(forecast: Forecast | None) -> dict[str, float | None] | None:
    if forecast is None:
        return None
    return {
        "hw_max_ms": _ms(forecast.hardware_ns),
        "sw_ms": _ms(forecast.software_ns),
        "mean_ms": _ms(forecast.mean_ns),
    }


def _ms(time_ns: float | None) -> float | None:
    return None if time_ns is None else time_ns / 1e6
