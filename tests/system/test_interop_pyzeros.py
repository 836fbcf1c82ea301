"""A node of pyzeros, which shares no code with this project, and our board are peers."""

from __future__ import annotations

from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from processes import LIMIT_S, run

from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics, pack
from reconros_zenoh.ros.graph import NodeToken, parse

if TYPE_CHECKING:
    import pytest
    from conftest import Network

PEER = Path(__file__).with_name("pyzeros_peer.py")
ANGLE = pack(leg=4, alpha_q=700, beta_q=-900)


def test_a_foreign_node_sees_our_nodes_is_seen_and_is_answered(
    network: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = Event()

    def on_token(key: str, alive: bool) -> None:
        node = parse(key)
        if alive and isinstance(node, NodeToken) and node.node == "independent_peer":
            seen.set()

    watch = network.transport.watch_tokens("@ros2_lv/0/**", on_token)
    monkeypatch.setenv("CYDR_CACHE_DIR", str(tmp_path))
    done = run(network.endpoint, ANGLE, program=(str(PEER),))
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{inverse_kinematics(ANGLE)}\n", "")
    assert seen.wait(LIMIT_S)
    watch.close()
