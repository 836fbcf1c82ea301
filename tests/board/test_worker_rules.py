"""Workers on a small board: poll grids, several workers, and when a slot is reconfigured."""

from __future__ import annotations

import random
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_board import Log, Tickets, ignore, logging_thread, small_board, small_profile, stages

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.workers import until_poll_ns
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from reconros_zenoh.board.executor import ExecutorKind
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.board.software import SoftwareContext

SUB = CallbackKind.SUB


class SoftwareBoard:
    """A board with software workers only; the callbacks are those of its profile."""

    def __init__(self, profile: Profile, workers: int = 1, kind: ExecutorKind = "reconros") -> None:
        self.board = small_board(profile)
        self.environment = self.board.environment
        self.executor = Executor(self.board, workers, 0, kind=kind)
        self.log: Log = []
        assert profile.model is not None
        self.sources = {name: Tickets(self.board) for name in profile.model.callbacks}
        for name, source in self.sources.items():
            self.executor.add_sw_callback(name, SUB, source, self._callback(name))
            source.on_answer = partial(self._note, f"{name} done")
        self.executor.spin()

    def _callback(self, name: str) -> Any:
        # In virtual time the computation itself happens at the moment in which it starts.
        return lambda _, __: self._note(f"{name} starts")

    def _note(self, what: str) -> None:
        self.log.append((self.environment.now, what))


class HardwareBoard:
    """A board with one hardware worker for each slot."""

    def __init__(self, profile: Profile, slots: dict[str, list[int]]) -> None:
        self.board = small_board(profile, 1 + max(max(of) for of in slots.values()))
        self.environment = self.board.environment
        self.executor = Executor(self.board, 0, len(self.board.slots))
        self.log: Log = []
        self.sources = {name: Tickets(self.board) for name in slots}
        for name, source in self.sources.items():
            self.executor.add_hw_callback(name, slots[name], SUB, source, logging_thread(self.log, name))
        self.executor.spin()


def test_a_worker_that_never_waits_starts_at_once() -> None:
    board = SoftwareBoard(small_profile({"a": (100, 0)}, dispatch_ns=7))
    board.sources["a"].put_at(30)
    board.environment.run(until=1000)
    assert board.log == [(37, "a starts"), (137, "a done")]
    assert stages(board.sources["a"].timelines[0]) == {"dispatch": 7, "execution": 100}


@pytest.mark.parametrize(
    ("ready_ns", "begins_ns"), [(1, 1000), (999, 1000), (1000, 1000), (1001, 2000), (5500, 6000)]
)
def test_an_idle_worker_finds_work_at_its_next_poll(ready_ns: int, begins_ns: int) -> None:
    board = SoftwareBoard(small_profile({"a": (100, 0)}, software_poll_ns=1000))
    board.sources["a"].put_at(ready_ns)
    board.environment.run(until=10_000)
    assert board.log == [(begins_ns, "a starts"), (begins_ns + 100, "a done")]
    assert board.sources["a"].timelines[0].stages_ns["queue"] == begins_ns - ready_ns


def test_a_worker_that_is_through_looks_at_once_and_polls_from_then_on() -> None:
    board = SoftwareBoard(small_profile({"a": (130, 0)}, software_poll_ns=1000))
    board.sources["a"].put_at(900, 1100, 1400)
    board.environment.run(until=10_000)
    assert board.log == [
        (1000, "a starts"),
        (1130, "a done"),
        (1130, "a starts"),  # ready since 1100: taken without a wait
        (1260, "a done"),
        (2260, "a starts"),  # idle since 1260
        (2390, "a done"),
    ]


@given(st.integers(1, 50), st.lists(st.integers(1, 400), min_size=1, max_size=12))
def test_the_wake_up_is_rounded_up_to_the_grid_of_the_idle_worker(poll_ns: int, gaps_ns: list[int]) -> None:
    """Against a worker that really looks once per period."""
    busy_ns = 30
    ready_ns = [sum(gaps_ns[: i + 1]) for i in range(len(gaps_ns))]
    expected, now_ns = [], 0
    waiting = list(ready_ns)
    while waiting:
        if waiting[0] <= now_ns:
            expected.append(now_ns)
            waiting.pop(0)
            now_ns += busy_ns
        else:
            now_ns += poll_ns
    board = SoftwareBoard(small_profile({"a": (busy_ns, 0)}, software_poll_ns=poll_ns))
    board.sources["a"].put_at(*ready_ns)
    board.environment.run(until=now_ns + 1)
    assert [time_ns for time_ns, what in board.log if what == "a starts"] == expected


@pytest.mark.parametrize(("ready_ns", "begins_ns"), [(4000, 4970), (1970, 1970)])
def test_the_grid_drifts_with_the_root_of_the_polls_that_nobody_counted(
    ready_ns: int, begins_ns: int
) -> None:
    drawn: list[tuple[float, float]] = []

    class Script(random.Random):
        def gauss(self, mu: float = 0.0, sigma: float = 1.0) -> float:
            drawn.append((mu, sigma))
            return 30.0

    board = SoftwareBoard(small_profile({"a": (0, 0)}, software_poll_ns=1000, poll_jitter=0.05))
    board.board.randomness = Script()
    board.sources["a"].put_at(ready_ns)
    board.environment.run(until=10_000)
    assert board.log[0] == (begins_ns, "a starts")  # polled at 970, 1970, ...
    assert drawn == [(0, pytest.approx(1000 * 0.05 * (ready_ns / 1000) ** 0.5))]


@given(st.integers(1, 10**8), st.integers(0, 10**12), st.integers(0, 100))
def test_a_poll_is_never_more_than_a_period_away(poll_ns: int, idle_ns: int, seed: int) -> None:
    assert 0 <= until_poll_ns(poll_ns, idle_ns, 0.3, random.Random(seed)) <= poll_ns


def test_software_and_hardware_workers_poll_at_their_own_pace() -> None:
    board = small_board(
        small_profile({"a": (0, 10), "b": (10, 0)}, hardware_poll_ns=100, software_poll_ns=700), 1
    )
    executor = Executor(board, 1, 1)
    log: Log = []
    a, b = Tickets(board), Tickets(board)
    executor.add_hw_callback("a", [0], SUB, a, logging_thread(log, "a"))
    executor.add_sw_callback("b", SUB, b, lambda _, __: log.append((board.environment.now, "b starts")))
    executor.spin()
    for source in (a, b):
        source.put_at(50)
    board.environment.run(until=5000)
    assert log == [(700, "b starts"), (100 + 1000, "a starts"), (1110, "a is done")]


@pytest.mark.parametrize(("kind", "order"), [("reconros", "b c a b"), ("standard", "b a b c")])
def test_the_kind_of_the_executor_decides_who_is_next(kind: ExecutorKind, order: str) -> None:
    # ReconROS goes on behind the callback it served last; ROS 2 collects what is ready, a first.
    board = SoftwareBoard(small_profile(dict.fromkeys("abc", (100, 0))), kind=kind)
    board.sources["b"].put_at(0)
    for name in "abc":
        board.sources[name].put_at(50)
    board.environment.run(until=1000)
    assert " ".join(what[0] for _, what in board.log if what.endswith("starts")) == order


def test_the_standard_executor_waits_for_events_instead_of_polling() -> None:
    board = SoftwareBoard(small_profile({"a": (100, 0)}, software_poll_ns=1000), kind="standard")
    board.sources["a"].put_at(30)
    board.environment.run(until=5000)
    assert board.log == [(30, "a starts"), (130, "a done")]


def test_two_workers_run_two_callbacks_side_by_side_on_two_cores() -> None:
    board = SoftwareBoard(small_profile({"a": (100, 0), "b": (100, 0)}, dispatch_ns=10), workers=2)
    for source in board.sources.values():
        source.put_at(0)
    board.environment.run(until=1000)
    assert board.log == [(10, "a starts"), (10, "b starts"), (110, "a done"), (110, "b done")]


def test_two_workers_on_one_core_share_it() -> None:
    board = SoftwareBoard(small_profile({"a": (100, 0), "b": (50, 0)}, dispatch_ns=10, cores=1), workers=2)
    for source in board.sources.values():
        source.put_at(0)
    board.environment.run(until=1000)
    assert board.log == [(20, "a starts"), (20, "b starts"), (120, "b done"), (170, "a done")]


def test_one_worker_runs_one_callback_after_the_other() -> None:
    board = SoftwareBoard(small_profile({"a": (100, 0), "b": (100, 0)}), workers=1)
    for source in board.sources.values():
        source.put_at(0)
    board.environment.run(until=1000)
    assert board.log == [(0, "a starts"), (100, "a done"), (100, "b starts"), (200, "b done")]
    assert stages(board.sources["b"].timelines[0]) == {"queue": 100, "execution": 100}


def test_a_callback_never_runs_twice_at_once() -> None:
    board = SoftwareBoard(small_profile({"a": (100, 0)}), workers=2)
    board.sources["a"].put_at(0, 10, 20)
    board.environment.run(until=1000)
    assert [time_ns for time_ns, what in board.log if what == "a starts"] == [0, 100, 200]
    assert board.executor.calls == {"a": 3}


def test_two_slots_compute_side_by_side_but_are_reconfigured_one_after_the_other() -> None:
    board = HardwareBoard(small_profile({"a": (0, 5000), "b": (0, 5000)}), {"a": [0], "b": [1]})
    for source in board.sources.values():
        source.put_at(0)
    board.environment.run(until=20_000)
    assert board.log == [
        (1000, "a starts"),
        (2000, "b starts"),
        (6000, "a is done"),
        (7000, "b is done"),
    ]
    assert stages(board.sources["b"].timelines[0]) == {"reconfiguration": 2000, "execution": 5000}
    assert [slot.busy.ns for slot in board.board.slots.values()] == [5000, 5000]


def test_a_callback_that_has_ended_may_go_on_at_once_in_the_slot_of_another_worker() -> None:
    board = HardwareBoard(small_profile({"a": (0, 5000), "b": (0, 5000)}), {"a": [0, 1], "b": [0]})
    board.sources["a"].put_at(0, 10)
    board.sources["b"].put_at(20)
    board.environment.run(until=20_000)
    assert board.log == [
        (1000, "a starts"),
        (6000, "a is done"),  # b and another a wait: slot 0 takes b, so the idle slot 1 takes a
        (7000, "a starts"),
        (8000, "b starts"),
        (12_000, "a is done"),
        (13_000, "b is done"),
    ]


def test_callbacks_that_share_a_slot_push_each_other_out() -> None:
    board = HardwareBoard(small_profile({"a": (0, 100), "b": (0, 100)}), {"a": [0], "b": [0]})
    board.sources["a"].put_at(0, 10_000)
    board.sources["b"].put_at(5000)
    board.environment.run(until=20_000)
    assert [time_ns for time_ns, what in board.log if "starts" in what] == [1000, 6000, 11_000]
    assert board.board.slots[0].reconfigurations == 3


@given(
    st.dictionaries(
        st.sampled_from("abc"),
        st.lists(st.integers(0, 2), min_size=1, max_size=3, unique=True),
        min_size=1,
    ),
    st.lists(st.tuples(st.integers(0, 3000), st.sampled_from("abc")), max_size=25),
)
def test_a_slot_is_reconfigured_if_and_only_if_it_holds_another_bitstream(
    slots: dict[str, list[int]], tickets: list[tuple[int, str]]
) -> None:
    board = HardwareBoard(small_profile(dict.fromkeys(slots, (0, 300)), dispatch_ns=5), slots)
    ran: list[tuple[int, str]] = []  # slot and callback of each dispatch, in order
    select = board.executor.select

    def noting(worker: Any) -> Any:
        dispatch = select(worker)
        if dispatch is not None:
            ran.append((worker.resource, dispatch.entry.name))
        return dispatch

    board.executor.select = noting  # type: ignore[method-assign] # listens only
    now_ns = 0
    for gap_ns, name in tickets:
        now_ns += gap_ns
        if name in slots:
            board.sources[name].put_at(now_ns)
    board.environment.run(until=now_ns + 100_000)
    assert len(ran) == sum(name in slots for _, name in tickets), "every ticket is served"
    holds: dict[int, str] = {}
    changes = dict.fromkeys(board.board.slots, 0)
    for slot, name in ran:
        assert slot in slots[name]
        changes[slot] += holds.get(slot) != name
        holds[slot] = name
    assert {slot.slot_id: slot.reconfigurations for slot in board.board.slots.values()} == changes
    for source in board.sources.values():
        for timeline in source.timelines:
            assert sum(timeline.stages_ns.values()) == timeline.age_ns


def test_a_timer_is_taken_before_a_subscriber_that_waits_longer() -> None:
    board = small_board(small_profile({"sub": (100, 0), "tmr": (100, 0), "busy": (100, 0)}))
    executor = Executor(board, 1, 0)
    order: list[str] = []
    sources = {name: Tickets(board) for name in ("busy", "sub", "tmr")}

    def callback(name: str) -> Any:
        def run(_: object, __: SoftwareContext) -> None:
            order.append(name)

        return run

    for name, source in sources.items():
        kind = CallbackKind.TMR if name == "tmr" else SUB
        executor.add_sw_callback(name, kind, source, callback(name))
    executor.spin()
    for time_ns, source in enumerate(sources.values()):
        source.put_at(time_ns)
    board.environment.run(until=1000)
    assert order == ["busy", "tmr", "sub"]


def test_a_callback_may_run_in_software_and_in_a_slot() -> None:
    board = small_board(small_profile({"a": (5000, 10), "b": (5000, 10)}), 1)
    executor = Executor(board, 1, 1)
    log: Log = []
    sources = {name: Tickets(board) for name in "ab"}
    for name, source in sources.items():
        executor.add_sw_callback(name, SUB, source, ignore)
        executor.add_hw_callback(name, [0], SUB, source, logging_thread(log, name))
    executor.spin()
    for source in sources.values():
        source.put_at(0)
    board.environment.run(until=20_000)
    # The software worker looks first and takes a; the slot takes b.
    assert log == [(1000, "b starts"), (1010, "b is done")]
    assert stages(sources["a"].timelines[0]) == {"execution": 5000}
    assert executor.calls == {"a": 1, "b": 1}
