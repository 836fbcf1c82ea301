"""`reconros gateway` and a running board."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from processes import Process, run

from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from conftest import Network


def test_a_stream_that_nobody_on_the_board_has_is_a_warning(network: Network) -> None:
    board = ("--router", network.endpoint, "--name", "free", "--profile", "native")
    with Process("board", *board, "--mapping", "all_software") as process:
        process.wait_for("board free serves roundtrip")
        add = ("gateway", "free", "--router", network.endpoint, "--type", "std_msgs/UInt32", "--hmt")
        done = run(*add, "/a")
        warning = "no callback of board 'free' has a hardware-mapped end of {}. Its streams: none."
        assert (done.returncode, done.stderr) == (0, f"warning: {warning.format('/a')}\n")
        assert "/a <-> /a" in done.stdout
        done = run(*add, "/b", "--json")
        assert (done.returncode, done.stderr) == (0, "")
        answer = json.loads(done.stdout)
        assert answer["warning"] == warning.format("/b")
        assert len(answer["gateways"]) == 2


def test_the_type_of_a_topic_is_looked_up_in_the_domain_of_the_board(network: Network) -> None:
    board = ("--router", network.endpoint, "--name", "fifth", "--domain", "5", "--profile", "native")
    word = TypeRegistry().message("std_msgs/msg/UInt32")
    with (
        ZenohTransport.open(network.endpoint) as transport,
        Process("board", *board, "--mapping", "all_software") as process,
    ):
        Context(transport, 5).node("n").publisher(word, "/here")
        Context(transport, 0).node("n").publisher(word, "/elsewhere")
        process.wait_for("board fifth serves roundtrip")
        add = ("gateway", "fifth", "--router", network.endpoint, "--type", "std_msgs/String", "--hmt")
        done = run(*add, "/here")
        assert done.returncode == 2
        assert "/here has the type std_msgs/msg/UInt32, not std_msgs/msg/String" in done.stderr
        done = run(*add, "/elsewhere")
        assert done.returncode == 0, done.stderr
