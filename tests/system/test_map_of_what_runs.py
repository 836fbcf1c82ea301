"""`reconros map --live` with a running board."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from processes import run

from reconros_zenoh.rmw.node import Context

if TYPE_CHECKING:
    from conftest import Network

    from reconros_zenoh.ros.type_registry import TypeRegistry


def test_the_graph_of_a_board_and_its_clients(network: Network, types: TypeRegistry) -> None:
    node = Context(network.transport).node("camera", "/desktop")
    node.publisher(types.message("sensor_msgs/msg/Image"), "/image_raw")
    node.subscription(types.message("sensor_msgs/msg/Image"), "/filtered", lambda _: None)
    try:
        done = run("map", "--live", "--router", network.endpoint, "--hardware", "/sobel_node", "--json")
    finally:
        node.close()
    assert (done.returncode, done.stderr) == (0, "")
    result = json.loads(done.stdout)
    topics = {topic["name"]: (topic["publishers"], topic["subscribers"]) for topic in result["topics"]}
    assert topics["/image_raw"] == (["/desktop/camera"], ["/sobel_node"])
    assert topics["/filtered"] == (["/sobel_node"], ["/desktop/camera"])
    assert {"/image_raw", "/filtered"} <= set(result["t_sw"])
    assert result["crossings"]["all_software"] == 2
    assert any("/angle" in note for note in result["notes"])
