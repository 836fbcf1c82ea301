"""How boards are named and asked: `reconros/<board>/...`, msgpack, versioned."""

from __future__ import annotations

import logging
from contextlib import closing
from queue import SimpleQueue
from threading import Event
from typing import TYPE_CHECKING, Any

import msgpack
from pydantic import ValidationError

from reconros_zenoh.board.answers import VERSION, StatusAnswer
from reconros_zenoh.board.status import status
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.errors import TransportError, UsageError
from reconros_zenoh.transport.base import is_name

if TYPE_CHECKING:
    from pydantic import BaseModel

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.transport.base import Declaration, Reply, Request, Transport

_log = logging.getLogger(__name__)

_HOST_ANEW = b"host anew"
_ANSWER_NS = 2_000_000_000
_LONGEST_ANSWER = 10_000_000


def check_board_name(name: str) -> None:
    """Raise UsageError for what cannot name a board."""
    if not is_name(name):
        raise UsageError(f"{name!r} cannot name a board. Use letters, digits, `-`, `_` and `.`.")
    if name == "router":
        raise UsageError("'router' cannot name a board: it is what `reconros status router` asks for.")


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
        # The board's state belongs to its event loop.
        self._board.environment.post(self._reply_status, request, request.read() == _HOST_ANEW)

    def _reply_status(self, request: Request, host_anew: bool) -> None:
        request.reply((msgpack.packb(status(self._board, self._executor)),), None)
        if host_anew:
            self._board.host.forget_overruns()
            if isinstance(self._board.environment, WallEnvironment):
                self._board.environment.forget_lag()


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
