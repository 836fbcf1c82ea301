"""What a board tells about itself."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np

from reconros_zenoh.board.answers import VERSION
from reconros_zenoh.clock.wall import WallEnvironment

if TYPE_CHECKING:
    from collections.abc import Iterable

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.writers import TopicWriter

_AGES = {"age_p50_ms": 50, "age_p95_ms": 95, "age_max_ms": 100}


def status(board: Board, executor: Executor) -> dict[str, Any]:
    """Return what the board is and what it has done so far; called by its event loop.

    `host` says how well this host kept up: results later than the model had them ready (`overruns`), and, in
    wall time only, how late the event loop was (`lag_*`) and whether it goes before other threads
    (`real_time_priority`). All times are since the board was made.
    """
    overruns = board.host.overruns
    wall = board.environment if isinstance(board.environment, WallEnvironment) else None
    lag = wall.lag() if wall else None
    return {
        "version": VERSION,
        "board": board.name,
        "profile": board.profile.name,
        "domain": board.context.domain,
        "executor": executor.kind,
        "elapsed_ms": (board.environment.now - board.started_ns) / 1e6,
        "callbacks": executor.statistics(),
        "slots": [
            {
                "id": slot.slot_id,
                "holds": slot.holds.callback if slot.holds else None,
                "reconfigurations": slot.reconfigurations,
                "reconfiguration_ms": slot.reconfiguring.ns / 1e6,
                "icap_wait_ms": slot.waiting.ns / 1e6,
                "busy_ms": slot.busy.ns / 1e6,
            }
            for slot in board.slots.values()
        ],
        "use": _use(board),
        "publishers": _publishers(board.writers),
        "gateways": gateways(board),
        "hmt": {
            topic.key: {"passed": topic.passed, "dropped": topic.dropped, "waits": topic.waits}
            for topic in board.hardware_topics.values()
        },
        "spans_ms": board.spans.mean_ms(),
        "rejected": dict(board.context.rejections.counts()),
        "host": {
            "overruns": overruns.count,
            "overrun_ms": overruns.total_ns / 1e6,
            "lag_p50_us": lag.p50_us if lag else None,
            "lag_p99_us": lag.p99_us if lag else None,
            "real_time_priority": wall.has_real_time_priority if wall else None,
        },
    }


def _use(board: Board) -> dict[str, float] | None:
    """Return for which share of its time each shared part of a board was busy, None where none is modelled.

    Of the cores the share of all together; the stack is busy with a message until that is through, what it
    waits for cores included.
    """
    elapsed_ns = board.environment.now - board.started_ns
    if board.profile.model is None or not elapsed_ns:
        return None
    return {
        "cores": board.cpu.cores.use(elapsed_ns),
        "icap": sum(slot.reconfiguring.ns for slot in board.slots.values()) / elapsed_ns,
        "memif": board.memif.bus.use(elapsed_ns),
        "stack": board.dds.busy.ns / elapsed_ns,
    }


def _publishers(writers: Iterable[TopicWriter]) -> dict[str, dict[str, float | None]]:
    """Return by topic what left the board and what did not; ages are those of the last messages [ms]."""
    topics: defaultdict[str, list[TopicWriter]] = defaultdict(list)
    for writer in writers:
        topics[writer.topic].append(writer)
    told: dict[str, dict[str, float | None]] = {}
    for topic, of_topic in topics.items():
        ages_ms = np.concatenate([np.array(writer.ages_ns, np.float64) for writer in of_topic]) / 1e6
        told[topic] = {
            "sent": sum(writer.sent for writer in of_topic),
            "dropped": sum(writer.dropped for writer in of_topic),
            **dict.fromkeys(_AGES),
        }
        if ages_ms.size:
            told[topic] |= dict(
                zip(_AGES, np.percentile(ages_ms, list(_AGES.values())).tolist(), strict=True)
            )
    return told


def gateways(board: Board) -> list[dict[str, Any]]:
    """Return the gateways of a board and what passed them; called by its event loop.

    `late` messages came between request and cancel; `refused` ones did not fit a FIFO.
    """
    return [
        {
            "name": gateway.name,
            "hmt": gateway.pair.hmt,
            "smt": gateway.pair.smt,
            "type": gateway.type,
            "qos": gateway.qos.words(),
            "slot": gateway.slot_id,
            "to_hmt": gateway.to_hmt,
            "to_smt": gateway.to_smt,
            "late": gateway.late,
            "dropped": gateway.dropped,
            "refused": gateway.refused,
        }
        for gateway in board.gateways
    ]
