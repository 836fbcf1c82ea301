"""`reconros gateway`: the gateways of a running board."""

from __future__ import annotations

import json
import sys
from typing import Annotated, Any

import typer

from reconros_zenoh.cli.options import ENDPOINT, AsJson, Router
from reconros_zenoh.cli.printable import printable
from reconros_zenoh.errors import UsageError
from reconros_zenoh.transport.zenoh import ZenohTransport

_COUNTS = ("to_hmt", "to_smt", "late", "dropped", "refused")


def gateway(
    board: Annotated[str, typer.Argument(help="The board.")] = "board0",
    hmt: Annotated[
        str | None,
        typer.Option(metavar="TOPIC", help="Add one: its hardware-mapped topic.", show_default=False),
    ] = None,
    smt: Annotated[
        str | None,
        typer.Option(
            metavar="TOPIC",
            help="Its software-mapped topic.",
            show_default="the name of the hardware-mapped one",
        ),
    ] = None,
    message_type: Annotated[
        str | None, typer.Option("--type", metavar="PKG/TYPE", help="Its message type.", show_default=False)
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="The name of its node.", show_default="after the topic")
    ] = None,
    reliability: Annotated[
        str | None,
        typer.Option(
            "--qos-reliability", metavar="WORD", help="reliable or best_effort.", show_default="reliable"
        ),
    ] = None,
    durability: Annotated[
        str | None,
        typer.Option(
            "--qos-durability", metavar="WORD", help="volatile or transient_local.", show_default="volatile"
        ),
    ] = None,
    history: Annotated[
        str | None,
        typer.Option(
            "--qos-history", metavar="WORD", help="keep_last or keep_all.", show_default="keep_last"
        ),
    ] = None,
    depth: Annotated[
        int | None, typer.Option("--qos-depth", help="How many messages a queue keeps.", show_default="10")
    ] = None,
    router: Router = ENDPOINT,
    as_json: AsJson = False,
) -> None:
    """List the gateways of a board, or add one.

    A gateway connects a hardware-mapped and a software-mapped topic, and is loaded into a free slot. The QoS
    is that of its ends on the software-mapped topic. Exit status 2 when no slot is free, or one of the topics
    has a gateway already or another type; a hardware-mapped topic that no callback has is a warning.
    """
    from reconros_zenoh.board.control import ask_status
    from reconros_zenoh.board.gateway_control import ask_gateways, check_type
    from reconros_zenoh.project.type_names import inline_message_type
    from reconros_zenoh.ros.names import resolve
    from reconros_zenoh.ros.qos import QosProfile

    policies = {"reliability": reliability, "durability": durability, "history": history, "depth": depth}
    qos = {policy: word for policy, word in policies.items() if word is not None}
    QosProfile.of_words(qos)
    add: dict[str, Any] | None = None
    if hmt is not None:
        if message_type is None:
            raise UsageError(
                "a gateway needs the type of its messages. Add for example --type sensor_msgs/Image."
            )
        try:
            type_name = inline_message_type(message_type)
        except ValueError as error:
            raise UsageError(f"{error} Write for example --type sensor_msgs/Image.") from None
        topic = resolve(hmt, "/", "gateway")
        add = {
            "name": name or f"gateway{topic.replace('/', '_')}",
            "hmt": topic,
            "smt": resolve(smt or hmt, "/", "gateway"),
            "type": type_name,
            "qos": qos,
        }
    elif smt is not None or message_type is not None or name is not None or qos:
        raise UsageError("a gateway needs its hardware-mapped topic. Add --hmt TOPIC.")
    with ZenohTransport.open(router, as_client=True) as transport:
        if add is not None:
            check_type(transport, ask_status(transport, board)["domain"], add["smt"], add["type"])
        answer = ask_gateways(transport, board, add)
    if as_json:
        print(json.dumps({"board": board, **answer}))
        return
    if answer["warning"]:
        print(printable(f"warning: {answer['warning']}"), file=sys.stderr)
    for each in answer["gateways"]:
        print(f"{each['name']}: {each['hmt']} <-> {each['smt']} ({each['type']}), slot {each['slot']}")
        print("  " + ", ".join(f"{policy} {word}" for policy, word in each["qos"].items()))
        print("  " + ", ".join(f"{count} {each[count]}" for count in _COUNTS))
    if not answer["gateways"]:
        print(f"board {board} has no gateway")
