"""Where a callback's time comes from: the profile's table, declared cycles, or what the host took."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import Tickets, ignore, small_board, small_profile

from reconros_zenoh.board import host as host_module
from reconros_zenoh.board.board import Board, SlotPlan
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.timing import Cycles, Native
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.board.software import SoftwareContext

SUB = CallbackKind.SUB
PROFILE = small_profile({"table": (100, 200)})  # cores and slots run at 1 GHz


def computing(thread: HardwareThread) -> Steps:
    yield from thread.compute(int)


def hardware_ns(board: Board, timing: Any, callback: Any = computing, name: str = "made_up") -> int:
    """How long the slot is busy with one call."""
    executor, source = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback(name, [0], SUB, source, callback, timing=timing)
    executor.spin()
    source.put(1)
    board.environment.run(until=1_000_000_000)
    return board.slots[0].busy.ns


def software_ns(board: Board, timing: Any, function: Any = ignore, name: str = "made_up") -> int:
    """How long one call takes."""
    executor, source = Executor(board, 1, 0), Tickets(board)
    executor.add_sw_callback(name, SUB, source, function, timing=timing)
    executor.spin()
    source.put(1)
    board.environment.run(until=1_000_000_000)
    return source.timelines[0].age_ns


def board_with_slots(*clocks_hz: int | None) -> Board:
    environment = VirtualEnvironment()
    context = Context(SimulatedNetwork(environment).transport("b0"), 0, environment.clock_ns)
    slots = [SlotPlan(slot, 100, 0, 0, clock_hz) for slot, clock_hz in enumerate(clocks_hz)]
    return Board(environment, context, PROFILE, tuple(slots))


def test_the_table_of_the_profile() -> None:
    assert hardware_ns(small_board(PROFILE, 1), None, name="table") == 200
    assert software_ns(small_board(PROFILE), None, name="table") == 100


def test_the_table_holds_at_the_profiles_clock_of_hardware_threads() -> None:
    assert hardware_ns(board_with_slots(None), None, name="table") == 200
    assert hardware_ns(board_with_slots(500_000_000), None, name="table") == 400


def test_what_is_declared_goes_before_the_table() -> None:
    assert hardware_ns(small_board(PROFILE, 1), Cycles(70), name="table") == 70
    assert software_ns(small_board(PROFILE), Cycles(60), name="table") == 60


def test_cycles_are_those_of_the_slots_clock() -> None:
    assert hardware_ns(board_with_slots(None), Cycles(120_000)) == 120_000
    assert hardware_ns(board_with_slots(120_000_000), Cycles(120_000)) == 1_000_000


def test_a_callback_declares_cycles_as_it_runs() -> None:
    def callback(thread: HardwareThread) -> Steps:
        for cycles in (6, 12):
            yield from thread.compute_cycles(cycles)

    assert hardware_ns(board_with_slots(100_000_000), Cycles(0), callback) == 180


@pytest.fixture
def every_run_takes_7_us(monkeypatch: pytest.MonkeyPatch) -> None:
    def measured(function: Any, *arguments: Any) -> tuple[Any, int]:
        return function(*arguments), 7_000

    for module in ("callback", "workers"):
        monkeypatch.setattr(f"reconros_zenoh.board.{module}.measured", measured)


@pytest.mark.usefixtures("every_run_takes_7_us")
def test_native_is_what_the_host_took_times_the_factor() -> None:
    assert hardware_ns(small_board(PROFILE, 1), Native(0.5)) == 3_500
    assert software_ns(small_board(PROFILE), Native(20)) == 140_000


def test_what_is_measured_is_really_computed_each_time() -> None:
    runs: list[int] = []

    def kernel(number: int) -> int:
        runs.append(number)
        return number

    def function(message: int, context: SoftwareContext) -> int:
        return context.compute(kernel, 5) + context.compute(kernel, 5)

    board = small_board(PROFILE)
    software_ns(board, Native(), function)
    assert runs == [5, 5]


def test_measuring_returns_result_and_time() -> None:
    result, took_ns = host_module.measured(sum, [1, 2])
    assert result == 3
    assert took_ns > 0


def test_the_native_profile_models_nothing() -> None:
    board = small_board(read_profile("native"), 1)

    def callback(thread: HardwareThread) -> Steps:
        yield from thread.compute(int)
        yield from thread.compute_cycles(10**9)

    assert hardware_ns(board, Cycles(10**9), callback) == 0


@pytest.mark.parametrize(
    ("timing", "told"),
    [
        (None, {"basis": "table", "ms": 0.0002}),
        (Cycles(2_000_000), {"basis": "cycles", "ms": 2.0}),
        (Native(3), {"basis": "native", "factor": 3}),
    ],
)
def test_the_status_says_where_the_time_comes_from(timing: Any, told: dict[str, Any]) -> None:
    board = small_board(PROFILE, 1)
    executor = Executor(board, 0, 1)
    executor.add_hw_callback("table", [0], SUB, Tickets(board), computing, timing=timing)
    assert executor.statistics()["table"]["timing"] == {"slot 0": told}


def test_the_status_says_it_for_each_slot() -> None:
    executor = Executor(board_with_slots(500_000_000, None), 0, 2)
    executor.add_hw_callback("table", [0, 1], SUB, Tickets(executor.board), computing)
    assert executor.statistics()["table"]["timing"] == {
        "slot 0": {"basis": "table", "ms": 0.0004},
        "slot 1": {"basis": "table", "ms": 0.0002},
    }


@pytest.mark.parametrize("profile", [PROFILE, read_profile("native")])
def test_the_status_of_the_native_profile(profile: Any) -> None:
    board = small_board(profile)
    executor = Executor(board, 1, 0)
    executor.add_sw_callback("table", SUB, Tickets(board), ignore, timing=Native())
    assert executor.statistics()["table"]["timing"] == {"software": {"basis": "native", "factor": 1.0}}


@pytest.mark.parametrize("hardware", [True, False])
def test_without_any_time_it_is_refused(hardware: bool) -> None:
    board = small_board(PROFILE, 1)
    executor = Executor(board, 1, 1)
    add: Any = executor.add_sw_callback
    how: Any = ignore
    if hardware:
        add, how = partial(executor.add_hw_callback, slots=[0]), computing
    option = f"app.register {'hardware' if hardware else 'software'}_timing, or add a section"
    with pytest.raises(UsageError, match=rf"timing=Cycles\(n\) or timing=Native\(factor\), in {option}"):
        add("walk", kind=SUB, source=Tickets(board), **{"thread" if hardware else "function": how})


@pytest.mark.parametrize("number", [np.uint8, np.int32, np.uint32, np.float32])
def test_cycles_from_a_number_of_a_message(number: Any) -> None:
    def as_long_as_the_message_says(thread: HardwareThread) -> Steps:
        yield from thread.compute(int)
        yield from thread.compute_cycles(number(200))

    board = board_with_slots(1_000_000)
    assert hardware_ns(board, Cycles(number(100)), as_long_as_the_message_says) == 300_000


NO_CYCLES = (-1, "10", None, float("nan"), float("inf"))


@pytest.mark.parametrize("count", NO_CYCLES)
def test_cycles_that_cannot_be(count: Any) -> None:
    with pytest.raises(UsageError) as caught:
        Cycles(count)
    assert str(caught.value) == f"Cycles({count!r}): write 0 or more cycles."


@pytest.mark.parametrize("count", NO_CYCLES)
@pytest.mark.parametrize("profile", [PROFILE, read_profile("native")])
def test_steps_of_cycles_that_cannot_be(count: Any, profile: Profile) -> None:
    told = []

    def computing_less_than_nothing(thread: HardwareThread) -> Steps:
        try:
            yield from thread.compute_cycles(count)
        except UsageError as error:
            told.append(str(error))

    hardware_ns(small_board(profile, 1), Cycles(0), computing_less_than_nothing)
    assert told == [f"compute_cycles({count!r}): write 0 or more cycles."]


@pytest.mark.parametrize("factor", [0, -1, "2", None, float("nan"), float("inf")])
def test_a_factor_that_cannot_be(factor: Any) -> None:
    with pytest.raises(UsageError) as caught:
        Native(factor)
    assert str(caught.value) == f"Native({factor!r}): write a factor above 0."
