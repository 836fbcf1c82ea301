"""Declaring gateways on a running board: `reconros/<board>/gateway`, msgpack, versioned."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgpack
from pydantic import BaseModel, ConfigDict, ValidationError

from reconros_zenoh.board.answers import VERSION, GatewayAnswer
from reconros_zenoh.board.control import ask
from reconros_zenoh.board.status import gateways
from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, parse, tokens_expression
from reconros_zenoh.ros.names import resolve, type_name_of
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from reconros_zenoh.board.board import Board
    from reconros_zenoh.ros.type_registry import TypeRegistry
    from reconros_zenoh.transport.base import Request, Transport

_LOOK_NS = 1_000_000_000
_LONGEST_QUESTION = 10_000
_OF_TOPICS = (EndpointKind.PUBLISHER, EndpointKind.SUBSCRIPTION)


class _Wanted(BaseModel):
    """A gateway to be added."""

    model_config = ConfigDict(strict=True)

    name: str
    hmt: str
    smt: str
    type: str
    qos: dict[str, str | int] = {}


class _Question(BaseModel):
    """What a board is asked; anybody in the network can ask anything."""

    model_config = ConfigDict(strict=True)

    version: int
    add: _Wanted | None = None


class GatewayServer:
    """Answers `reconros/<board>/gateway` with the gateways, after adding the one that the request has.

    It is loaded into the first reconfigurable slot that no callback may run in and no gateway has.
    """

    def __init__(self, board: Board, types: TypeRegistry) -> None:
        self._board = board
        self._types = types
        self._declaration = board.context.transport.serve(f"reconros/{board.name}/gateway", self._on_request)

    def close(self) -> None:
        """Withdraw the queryable."""
        self._declaration.close()

    def _on_request(self, request: Request) -> None:
        # The board's state belongs to its event loop.
        self._board.environment.post(self._reply, request)

    def _reply(self, request: Request) -> None:
        refused = warning = None
        try:
            warning = self._add(request.read())
        except UsageError as error:
            refused = str(error)
        except ValidationError as error:
            refused = f"no request: {error.errors()[0]['msg']}"
        except ValueError as error:
            refused = f"no request: {error!r}"
        answer = {"gateways": gateways(self._board), "refused": refused, "warning": warning}
        request.reply((msgpack.packb({"version": VERSION, **answer}),), None)

    def _add(self, payload: memoryview) -> str | None:
        """Add the gateway that is asked for, if any; return what is odd about it."""
        if len(payload) > _LONGEST_QUESTION:  # to read it would keep the board, and the answer would quote it
            raise UsageError(f"no request: it has {len(payload)} bytes.")
        question = _Question.model_validate(msgpack.unpackb(payload))
        if question.version != VERSION:
            raise UsageError(f"board {self._board.name!r} speaks version {VERSION} of the gateway.")
        wanted = question.add
        if wanted is None:
            return None
        hmt, smt = (resolve(topic, "/", wanted.name) for topic in (wanted.hmt, wanted.smt))
        message_type, qos = self._types.message(wanted.type), QosProfile.of_words(wanted.qos)
        unused = self._unused(hmt)
        slot = self._free_slot()
        if slot is None:
            raise UsageError(
                f"board {self._board.name!r} has no slot for a gateway: it has no reconfigurable slot "
                "without a callback or a gateway. Add one to its build.cfg, or declare the gateway there."
                + (f" Besides, {unused}" if unused else "")
            )
        self._board.add_gateway(wanted.name, hmt, smt, message_type, slot, qos, at_power_up=False)
        return unused

    def _unused(self, hmt: str) -> str | None:
        """Return in a sentence that no callback has an end of this hardware-mapped topic, None if one has."""
        streams = [name for name, topic in self._board.hardware_topics.items() if topic.has_callback]
        if hmt in streams:
            return None
        return (
            f"no callback of board {self._board.name!r} has a hardware-mapped end of {hmt}. "
            f"Its streams: {', '.join(streams) or 'none'}."
        )

    def _free_slot(self) -> int | None:
        """Return the first slot that can be given to a gateway while the board runs, None without one."""
        free = (
            slot_id
            for slot_id, slot in sorted(self._board.slots.items())
            if slot.reconfigurable and not slot.tenants
        )
        return next(free, None)


def ask_gateways(transport: Transport, board: str, add: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return the `gateways` of the board of that name, and a `warning` about an added one, or None.

    `add` is one to be declared first: its `name`, the absolute topic names `hmt` and `smt`, its `type`
    (`sensor_msgs/msg/Image`), and its `qos` in words (`QosProfile.of_words`). Raise UsageError when the board
    refuses it.
    """
    question = {"version": VERSION, **({"add": add} if add is not None else {})}
    answer = ask(transport, board, "gateway", msgpack.packb(question), GatewayAnswer)
    if answer["refused"] is not None:
        raise UsageError(answer["refused"])
    return {"gateways": answer["gateways"], "warning": answer["warning"]}


def check_type(transport: Transport, domain: int, topic: str, type_name: str) -> None:
    """Raise UsageError when the software-mapped topic is there with another type."""
    for key in transport.tokens(tokens_expression(domain), _LOOK_NS):
        token = parse(key)
        if isinstance(token, EndpointToken) and token.kind in _OF_TOPICS and token.name == topic:
            found = type_name_of(token.dds_type)
            if found != type_name:
                raise UsageError(
                    f"the topic {topic} has the type {found}, not {type_name}. Give its type, or another "
                    "topic."
                )
