"""Each gateway of a project has a slot for itself, or the project is refused with file and line."""

from __future__ import annotations

from dataclasses import replace

import networkx as nx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from networkx.algorithms import bipartite

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.gateway_slots import gateway_slots
from reconros_zenoh.project.mapping_file import ProjectMapping

SLOTS = """[HwSlot@slot(0:1)]
Id = 0
Reconfigurable = true
Region_0 = SLICE_X0Y0:SLICE_X9Y9
Region_1 = SLICE_X0Y10:SLICE_X9Y19
[ResourceGroup@g]
node = rosnode, "/n"
"""
THREAD = "[ReconosThread@t]\nSlot = slot(0)\nHwSource = hls\nSwSource = c\nResourceGroup = g\n"
GATEWAY = "[ROSGateway@{}]\nSlot = {}\nHWTopic = {}\nSWTopic = {}\nMsgType = sensor_msgs/Image\n"


def configuration(tmp_path, text):
    path = tmp_path / "build.cfg"
    path.write_text(SLOTS + text)
    return read_build_cfg(path)


@pytest.mark.parametrize(("slots", "mapped", "taken"), [("*", (), 1), ("*", (1,), 0), ("0", (), 0)])
def test_a_gateway_takes_a_slot_that_no_thread_wants_if_it_can(tmp_path, slots, mapped, taken) -> None:
    gateway = GATEWAY.format("g", f"slot({slots})", "/a", "/b")
    read = configuration(tmp_path, THREAD + gateway)
    assert gateway_slots(read, {"t": mapped}) == {"g": taken}


def test_a_gateway_that_can_be_anywhere_leaves_its_slot_to_one_that_cannot(tmp_path) -> None:
    anywhere = GATEWAY.format("g", "slot(*)", "/a", "/b")
    there = GATEWAY.format("h", "slot(0)", "/c", "/d")
    assert gateway_slots(configuration(tmp_path, anywhere + there), {}) == {"h": 0, "g": 1}


def between(tmp_path, lists, threads=()):
    """Return a configuration with a thread that is built for `threads`, and a gateway for each list."""
    gateway = GATEWAY.format("g", "slot(1)", "/a", "/b")
    read = configuration(tmp_path, THREAD + gateway)
    return replace(
        read,
        threads=(replace(read.threads[0], slots=tuple(threads)),),
        gateways=tuple(
            replace(read.gateways[0], name=f"g{number}", line=100 + number, slots=tuple(slots))
            for number, slots in enumerate(lists)
        ),
    )


def test_a_gateway_moves_where_another_has_no_other_slot(tmp_path) -> None:
    read = between(tmp_path, [(0, 1), (1, 2), (0, 1)])
    assert gateway_slots(read, {}) == {"g0": 1, "g1": 2, "g2": 0}


def test_all_gateways_that_no_slot_is_left_for_are_named(tmp_path) -> None:
    read = between(tmp_path, [(2, 3), (0, 1), (0, 1), (1, 0), (), (5, 1)])
    with pytest.raises(FileError) as refused:
        gateway_slots(read, {"t": (5,)})
    assert refused.value.line == 103
    assert (
        "The gateway g3 has no slot for itself: its Slot names only those of the gateway g2 and the gateway "
        "g1. The gateway g4 has no slot for itself: its Slot names none. The gateway g5 has no slot for "
        "itself: its Slot names only those of the callback t and the gateway g2. Name another one there."
    ) in str(refused.value)


def first_come(lists, threads):
    """Return the slots of the gateways when each keeps the first that it finds, None when one finds none."""
    slots: dict[str, int] = {}
    for number, own in sorted(enumerate(lists), key=lambda item: len(item[1])):
        free = [slot for slot in own if slot not in slots.values()]
        if not free:
            return None
        slots[f"g{number}"] = min(free, key=lambda slot: slot in threads)
    return slots


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    lists=st.lists(st.lists(st.integers(0, 6), max_size=4, unique=True), max_size=7),
    threads=st.sets(st.integers(0, 6)),
)
def test_all_gateways_have_a_slot_if_they_can_and_the_first_that_is_free_if_that_does(
    tmp_path, lists, threads
) -> None:
    read = between(tmp_path, lists, threads)
    graph = nx.Graph()
    graph.add_nodes_from(f"g{number}" for number in range(len(lists)))
    graph.add_edges_from((f"g{number}", slot) for number, own in enumerate(lists) for slot in own)
    most = len(bipartite.maximum_matching(graph, [f"g{number}" for number in range(len(lists))])) // 2
    if most < len(lists):
        with pytest.raises(FileError) as refused:
            gateway_slots(read, {})
        assert str(refused.value).count("has no slot for itself") == len(lists) - most
        return
    slots = gateway_slots(read, {})
    assert len(set(slots.values())) == len(lists)
    assert all(slots[f"g{number}"] in own for number, own in enumerate(lists))
    assert first_come(lists, threads) in (None, slots)


def test_a_gateway_whose_slots_are_none_is_refused(tmp_path) -> None:
    gateway = GATEWAY.format("g", "other(*)", "/a", "/b")
    with pytest.raises(FileError, match="gateway g has no slot for itself: its Slot names none"):
        gateway_slots(configuration(tmp_path, gateway), {})


def test_without_a_mapping_file_a_gateway_keeps_its_slot(tmp_path) -> None:
    thread = THREAD.replace("slot(0)", "slot(*)")
    read = configuration(tmp_path, thread + GATEWAY.format("g", "slot(1)", "/a", "/b"))
    mapping = ProjectMapping.default(read)
    assert mapping.callbacks["t"].slots == (0,)
    assert gateway_slots(read, {"t": mapping.callbacks["t"].slots}) == {"g": 1}
