"""`reconros gateway` and a running board."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from processes import Process, run

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
