"""The round-trip application as a whole: its spans are its round trips, and its times those of Table I."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from small_board import start

from host_clients.suite import exchange
from reconros_zenoh.board.board import Board
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.experiments.roundtrip import CLIENTS, application_folder
from reconros_zenoh.project.application import Application
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    import simpy
    from small_board import Steps

    from reconros_zenoh.project.loader import Project

MAPPINGS = ("all_software", "mixed", "all_hardware")
PERIOD_NS = 250_000_000
TABLE_I_MS = {"sobel": 16.5, "sort": 0.85, "mnist": 11.9, "inverse": 0.35, "hash": 81.0}
TABLE_I_SOFTWARE_MS = {"sobel": 42.0, "sort": 41.0, "mnist": 16.5, "inverse": 1.5, "hash": 94.0}


@pytest.fixture(scope="module")
def project() -> Project:
    return load_project(application_folder())


class Seen(NamedTuple):
    """What a client that runs alone saw, and what the board accounts for it [ns per message]."""

    trips_ns: list[int]
    stages_ns: dict[str, float]


def run_alone(project: Project, mapping: str, client: str, trips: int) -> Seen:
    """Run one client against the application, nobody else, and let it make some round trips."""
    environment = VirtualEnvironment()
    network = SimulatedNetwork(environment)
    context = Context(network.transport("b0"), 0, environment.clock_ns)
    board = Board(environment, context, read_profile("miniitx-zynq7100"), project.slots)
    project.main(Application(project, board, project.mapping(mapping), None))

    asking = exchange(client, seed=1)
    answers: list[tuple[int, Any]] = []
    arrived: list[simpy.Event] = [environment.event()]

    def arrive(answer: object) -> None:
        answers.append((environment.now, answer))
        arrived[0].succeed()
        arrived[0] = environment.event()

    node = Context(network.transport("c0"), 0, environment.clock_ns).node("client")
    asking.open(node, project.types(), arrive, lambda _: None)

    trips_ns: list[int] = []

    def loop() -> Steps:
        for index in range(trips):
            # The hash client never asks: the timer of the board does, every 250 ms.
            asked_ns = environment.now if asking.asks else (index + 1) * PERIOD_NS
            asking.ask(index, PERIOD_NS)
            yield arrived[0]
            arrived_ns, answer = answers[index]
            assert asking.is_right(index, answer)
            trips_ns.append(arrived_ns - asked_ns)

    environment.run(until=start(environment, loop()))
    stages_ms = board.spans.mean_ms()[client]
    return Seen(trips_ns, {stage: mean_ms * 1e6 for stage, mean_ms in stages_ms.items()})


@pytest.mark.parametrize("mapping", MAPPINGS)
@pytest.mark.parametrize("client", CLIENTS)
def test_the_spans_of_a_client_alone_are_its_round_trips(project: Project, mapping: str, client: str) -> None:
    seen = run_alone(project, mapping, client, trips=5)
    # Means of whole nanoseconds, in floats.
    assert sum(seen.stages_ns.values()) * 5 == pytest.approx(sum(seen.trips_ns), abs=1e-3)


@pytest.mark.parametrize("client", CLIENTS)
def test_in_hardware_the_time_from_start_to_completion_is_what_the_profile_says(
    project: Project, client: str
) -> None:
    """Table I gives the whole time; the profile keeps of it what the slot computes."""
    # Only one trip: later ones share the memory with the hash calculation.
    seen = run_alone(project, "all_hardware", client, trips=1)
    model = read_profile("miniitx-zynq7100").model
    assert model is not None
    source = model.callbacks[client].compute.source
    named_ms = float(re.findall(r"([\d.]+) ms with", source)[0])
    from_start_to_end_ns = sum(seen.stages_ns[stage] for stage in ("execution", "memif", "osif"))
    assert from_start_to_end_ns == pytest.approx(named_ms * 1e6, abs=100)


@pytest.mark.parametrize("client", CLIENTS)
def test_the_profile_names_the_times_of_table_i(client: str) -> None:
    model = read_profile("miniitx-zynq7100").model
    assert model is not None
    for quantity, published_ms in (
        (model.callbacks[client].compute, TABLE_I_MS[client]),
        (model.callbacks[client].software, TABLE_I_SOFTWARE_MS[client]),
    ):
        named = [float(number) for number in re.findall(r"([\d.]+) ms", quantity.source)]
        if quantity.basis == "calibrated":
            assert named[-1] == published_ms, "the published value stands beside the calibrated one"
        else:
            assert quantity.basis == "published"
            assert [*named, quantity.value][0] == published_ms


@pytest.mark.parametrize(
    ("slot", "lut", "dsp", "bram36", "size", "measured_ms"),
    [
        (0, 20800, 160, 60, 2838976, 24.0),
        (1, 20800, 160, 60, 2838976, 24.0),
        (2, 41600, 320, 120, 5285728, 38.4),
        (3, 40800, 280, 100, 4883328, 36.9),
    ],
)
def test_the_slots_are_those_of_table_ii(
    project: Project, slot: int, lut: int, dsp: int, bram36: int, size: int, measured_ms: float
) -> None:
    environment = VirtualEnvironment()
    context = Context(SimulatedNetwork(environment).transport("b0"))
    board = Board(environment, context, read_profile("miniitx-zynq7100"), project.slots)
    (plan,) = [plan for plan in project.slots if plan.slot_id == slot]
    assert (plan.lut, plan.dsp, plan.bram36) == (lut, dsp, bram36)
    assert board.slots[slot].bitstream_size == size
    # The regression of Section V-B against its own measurements.
    assert board.zycap.reconfiguration_ns(size) == pytest.approx(measured_ms * 1e6, rel=0.04)
    assert board.zycap.reconfiguration_ns(size) == round(size / 0.16) + 6_800_000
