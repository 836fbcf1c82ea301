"""What a board tells about itself, and how others ask: `reconros/<board>/...`, msgpack, versioned."""

from __future__ import annotations

import logging
import re
from collections import defaultdict
from contextlib import closing
from queue import SimpleQueue
from threading import Event
from typing import TYPE_CHECKING, Any

import msgpack
import numpy as np
from pydantic import ValidationError

from reconros_zenoh.board.answers import VERSION, StatusAnswer
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.errors import TransportError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pydantic import BaseModel

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.writers import TopicWriter
    from reconros_zenoh.transport.base import Declaration, Reply, Request, Transport

_log = logging.getLogger(__name__)

_NAME = re.compile(r"[A-Za-z0-9_.-]+")  # one part of a key
_HOST_ANEW = b"host anew"
_ANSWER_NS = 2_000_000_000
_LONGEST_ANSWER = 10_000_000
_AGES = {"age_p50_ms": 50, "age_p95_ms": 95, "age_max_ms": 100}


def check_board_name(name: str) -> None:
    """Raise UsageError for what cannot name a board."""
    if not _NAME.fullmatch(name):
        raise UsageError(f"{name!r} cannot name a board. Use letters, digits, `-`, `_` and `.`.")


def alive_key(board: str) -> str:
    """Return the key of the liveliness token that a ready board of this name holds."""
    return f"reconros/{board}/alive"


def claim_name(transport: Transport, board: str) -> None:
    """Take the name until the transport is closed; raise UsageError when another board has it.

    Of several that ask at the same time one gets it. Each claims the name first and then looks: who sees an
    owner, or a claim of a lower session id, gives way; the others have not looked yet when this one becomes
    the owner, or see its claim. Boards that could not see each other may have one name: when they can, each
    logs it.
    """
    claims, owners = f"reconros/{board}/claims/", f"reconros/{board}/owner/"
    mine = claims + transport.session_id
    transport.declare_token(mine)
    tokens = transport.tokens(f"reconros/{board}/*/*", _ANSWER_NS)
    if any(token.startswith(owners) or (token.startswith(claims) and token < mine) for token in tokens):
        raise UsageError(
            f"a board named {board!r} is running already. Stop it, or start this one with --name."
        )
    own = owners + transport.session_id

    def on_change(owner: str, is_alive: bool) -> None:
        if is_alive and owner != own:
            _log.warning("another board is named %r, and both answer clients: stop one", board)

    transport.watch_tokens(f"{owners}*", on_change)
    transport.declare_token(own)


class ControlServer:
    """Answers `reconros/<board>/status` and holds the board's liveliness token until closed."""

    def __init__(self, board: Board, executor: Executor) -> None:
        self._board = board
        self._executor = executor
        transport = board.context.transport
        self._declarations: list[Declaration] = [
            transport.serve(f"reconros/{board.name}/status", self._on_status),
            transport.declare_token(alive_key(board.name)),
        ]

    def close(self) -> None:
        """Withdraw token and queryable."""
        for declaration in reversed(self._declarations):
            declaration.close()

    def _on_status(self, request: Request) -> None:
        # The board's state belongs to the thread of its event loop.
        self._board.environment.post(self._reply_status, request, request.read() == _HOST_ANEW)

    def _reply_status(self, request: Request, host_anew: bool) -> None:
        request.reply((msgpack.packb(status(self._board, self._executor)),), None)
        if host_anew:
            self._board.host.forget_overruns()
            if isinstance(self._board.environment, WallEnvironment):
                self._board.environment.forget_lag()


def status(board: Board, executor: Executor) -> dict[str, Any]:
    """Return what the board is and what it has done so far; called by the thread of its event loop.

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
        "use": use(board),
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


def use(board: Board) -> dict[str, float] | None:
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
    """Return the gateways of a board and what passed them; called by the thread of its event loop.

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


def ask_status(transport: Transport, board: str, *, host_anew: bool = False) -> dict[str, Any]:
    """Return the status of the board of that name; raise TransportError when it does not answer.

    With `host_anew` what it says of its host counts from then on, for all who ask.
    """
    return ask(transport, board, "status", _HOST_ANEW if host_anew else b"", StatusAnswer)


def ask(
    transport: Transport, board: str, what: str, question: bytes, form: type[BaseModel]
) -> dict[str, Any]:
    """Return what the board answers on `reconros/<board>/<what>`.

    Raise TransportError without an answer, and for one that is not of this form, UsageError for what cannot
    name a board.
    """
    check_board_name(board)
    found = Event()
    replies: SimpleQueue[Reply | None] = SimpleQueue()

    def on_matching(matching: bool) -> None:
        if matching:
            found.set()

    with closing(transport.request(f"reconros/{board}/{what}", on_matching)) as querier:
        # A session that is just open has not heard of the board yet.
        found.wait(_ANSWER_NS / 1e9)
        querier.get((question,), None, replies.put, _ANSWER_NS)
        reply = replies.get()
    if reply is None or reply.payload is None:
        running = [token.split("/")[1] for token in transport.tokens(alive_key("*"), _ANSWER_NS)]
        if board in running:
            raise TransportError(
                f"board {board!r} is running but does not answer: it may be too busy. Ask again, or look at "
                "its log."
            )
        others = f", or name one that runs: {', '.join(running)}" if running else ""
        raise TransportError(
            f"no board named {board!r} answers. Start it with `reconros board --name {board}`{others}."
        )
    if len(reply.payload) > _LONGEST_ANSWER:
        raise _no_answer(board, what, f"it has {len(reply.payload)} bytes")
    try:
        answer: dict[str, Any] = msgpack.unpackb(reply.payload)
        if isinstance(answer, dict) and answer.get("version") != VERSION:
            raise TransportError(
                f"board {board!r} speaks version {answer.get('version')} of the {what}, not {VERSION}. "
                "Ask it with the reconros that it was started with."
            )
        form.model_validate(answer)
    except ValidationError as error:
        first = error.errors()[0]
        raise _no_answer(board, what, f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    except ValueError as error:
        raise _no_answer(board, what, repr(error)) from None
    return answer


def _no_answer(board: str, what: str, problem: str) -> TransportError:
    return TransportError(
        f"what calls itself board {board!r} answers with what is no {what} ({problem}). "
        "Find out what runs there, and of which version of reconros it is."
    )
