"""The computation graph of what runs, read from the liveliness tokens of the network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.errors import UsageError
from reconros_zenoh.mapping.graph import ComputationGraph, Side, Topic
from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, parse, tokens_expression

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from reconros_zenoh.transport.base import Transport

_TIMEOUT_NS = 5 * 10**9
_INFRASTRUCTURE = ("/rosout", "/parameter_events")


def read_live_graph(transport: Transport, domain: int, hardware: Collection[str]) -> ComputationGraph:
    """Return the graph of a ROS domain as it is at this moment; nothing in it is changed.

    `hardware` names the nodes that are in hardware, which no token tells. Blocks for as long as
    `Transport.tokens` does; raise UsageError for a node that does not run.
    """
    return live_graph(transport.tokens(tokens_expression(domain), _TIMEOUT_NS), hardware)


def live_graph(tokens: Iterable[str], hardware: Collection[str]) -> ComputationGraph:
    """Return the graph that these tokens announce; raise UsageError for an unknown node in `hardware`.

    What ROS 2 keeps for itself is left out (/rosout, /parameter_events, hidden topics), and so is a topic
    that nobody publishes on at the moment.
    """
    announced = [token for key in sorted(tokens) if (token := parse(key)) is not None]
    names = dict.fromkeys(_full_name(token.namespace, token.node) for token in announced)
    wanted = [_full_name("/", node) for node in hardware]
    for node in wanted:
        if node not in names:
            raise UsageError(
                f"no node {node} runs. Name one of {', '.join(names) or 'those that run: there is none'}."
            )
    ends: dict[str, dict[EndpointKind, dict[str, None]]] = {}
    for token in announced:
        if isinstance(token, EndpointToken) and _is_topic(token):
            topic = ends.setdefault(token.name, {EndpointKind.PUBLISHER: {}, EndpointKind.SUBSCRIPTION: {}})
            topic[token.kind][_full_name(token.namespace, token.node)] = None
    silent = [name for name, topic in ends.items() if not topic[EndpointKind.PUBLISHER]]
    in_network = {node for topic in ends.values() for nodes in topic.values() for node in nodes}
    notes = ["Services, actions and the topics that ROS 2 keeps for itself are left out."]
    if not hardware:
        notes.append("No token tells what is in hardware: name the nodes with --hardware.")
    notes += [
        f"{node} runs, but has no topic in the network: of streams inside an FPGA no token tells."
        for node in wanted
        if node not in in_network
    ]
    sessions = {token.zid for token in announced if _full_name(token.namespace, token.node) in wanted}
    if len(sessions) > 1:
        notes.append(
            f"The nodes in hardware run in {len(sessions)} processes, and a stream stays inside one board. "
            "If they are not of one board, name those of one at a time."
        )
    if silent:
        notes.append(f"Left out because nobody publishes on them at the moment: {', '.join(silent)}.")
    return ComputationGraph(
        {name: Side.HARDWARE if name in wanted else Side.SOFTWARE for name in names},
        tuple(
            Topic(name, tuple(topic[EndpointKind.PUBLISHER]), tuple(topic[EndpointKind.SUBSCRIPTION]))
            for name, topic in ends.items()
            if name not in silent
        ),
        tuple(notes),
    )


def _full_name(namespace: str, node: str) -> str:
    return f"{namespace.rstrip('/')}/{node.lstrip('/')}"


def _is_topic(token: EndpointToken) -> bool:
    """Tell whether the endpoint is one of a topic of the application; a part with `_` hides a name."""
    return (
        token.kind in {EndpointKind.PUBLISHER, EndpointKind.SUBSCRIPTION}
        and token.name not in _INFRASTRUCTURE
        and "/_" not in token.name
    )
