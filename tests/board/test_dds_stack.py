"""Link and communication stack: what a message costs between the network and the board's queues."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from small_board import Log, small_profile, stages, start

from reconros_zenoh.board.cpu import Cpu
from reconros_zenoh.board.dds import DdsStack
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    import simpy
    from small_board import Steps

    from reconros_zenoh.board.profile import Profile

COSTS = {
    "cores": 1,
    "link_ns": 500,
    "link_byte_ns": 2,
    "dds_message_ns": 100,
    "dds_byte_ns": 3,
    "dds_byte_received_ns": 5,
    "dds_byte_sent_ns": 4,
    "large_from": 1000,
}
PROFILE = small_profile(**COSTS)  # type: ignore[arg-type] # each value fits its parameter
LOSSY = small_profile(
    **COSTS,  # type: ignore[arg-type] # each value fits its parameter
    nack_probability=0.1,
    nack_delay_ns=10_000,
    loss_probability=0.01,
    loss_probability_busy=0.3,
    heartbeat_ns=3_000_000,
)
NATIVE = PROFILE.model_copy(update={"model": None})


class Script(random.Random):
    """Draws the numbers it is given; a logarithmic normal factor is 1.5."""

    def __init__(self, *numbers: float) -> None:
        super().__init__()
        self.numbers = list(numbers)
        self.deviations: list[tuple[float, float]] = []

    def random(self) -> float:
        return self.numbers.pop(0)

    def lognormvariate(self, mu: float = 0.0, sigma: float = 1.0) -> float:
        self.deviations.append((mu, sigma))
        return 1.5


class Stack:
    """A stack with a log of what is through when."""

    def __init__(self, profile: Profile = PROFILE, *draws: float) -> None:
        self.environment = VirtualEnvironment()
        self.cpu = Cpu(self.environment, 1)
        self.draws = Script(*draws)
        self.log: Log = []
        self._stack = DdsStack(self.environment, self.cpu, profile.model, self.draws)

    def begin(
        self, name: str, direction: str, size: int, transit_ns: int = 0
    ) -> tuple[Timeline, simpy.Event]:
        timeline = Timeline(self.environment, self.environment.now - transit_ns)

        def follow() -> Steps:
            if direction == "in":
                yield from self._stack.receive(size, transit_ns, timeline)
            else:
                yield from self._stack.send(size, timeline)
            self.log.append((self.environment.now, name))

        return timeline, start(self.environment, follow())

    def receive(self, size: int, transit_ns: int = 0) -> dict[str, int]:
        return self._alone("in", size, transit_ns)

    def send(self, size: int) -> dict[str, int]:
        return self._alone("out", size, 0)

    def steps_of_best_effort(self, size: int) -> Steps:
        return self._stack.receive(size, 0, Timeline(self.environment, 0), reliable=False)

    def _alone(self, direction: str, size: int, transit_ns: int) -> dict[str, int]:
        timeline, end = self.begin("alone", direction, size, transit_ns)
        self.environment.run(until=end)
        assert timeline.age_ns == self.environment.now - timeline.started_ns
        return stages(timeline)


def test_a_message_crosses_the_link_and_then_the_stack() -> None:
    assert Stack().receive(8) == {"transport": 500 + 8 * 2, "dds": 100 + 8 * 3}


def test_a_message_of_the_board_passes_the_stack_and_then_the_link() -> None:
    assert Stack().send(8) == {"dds": 124, "transport": 516}


def test_messages_pass_the_stack_one_at_a_time_whatever_their_direction() -> None:
    stack = Stack()
    stack.begin("a in", "in", 0)  # over the link at 500
    stack.environment.run(until=450)
    stack.begin("b out", "out", 0)  # in the stack from 450 to 550, then on the link
    stack.begin("c out", "out", 0)  # behind it
    stack.environment.run()
    assert stack.log == [
        (750, "a in"),  # behind b and c
        (550 + 500, "b out"),
        (650 + 500, "c out"),
    ]


def test_a_small_message_behind_a_large_one_waits_for_it() -> None:
    stack = Stack()
    stack.begin("large", "out", 2000)  # in the stack until 8100
    small, _ = stack.begin("small", "out", 0)
    stack.environment.run()
    assert stages(small) == {"dds": 8_100 + 100, "transport": 500}


def test_a_large_message_crosses_the_link_before_or_after_the_stack_works_on_it() -> None:
    assert Stack(PROFILE, 1.0, 1.0).receive(2000) == {"transport": 4500, "dds": 10_100}
    assert Stack().send(2000) == {"dds": 8_100, "transport": 4500}


def test_a_large_message_costs_more_per_byte() -> None:
    assert Stack().receive(1000)["dds"] == 100 + 1000 * 3
    assert Stack(PROFILE, 1.0, 1.0).receive(1001)["dds"] == 100 + 1001 * 5


def test_a_large_message_of_which_a_fragment_is_lost_is_sent_again_until_none_is() -> None:
    stack = Stack(LOSSY, 0.01, 0.09, 0.0, 0.1)
    assert stack.receive(2000) == {
        "transport": 4500,
        "dds": 10_100,
        "retransmission": 2 * (10_000 + 10_100),
    }
    assert stack.draws.numbers == []


def test_a_large_message_whose_repair_is_lost_too_waits_for_the_next_heartbeat() -> None:
    stack = Stack(LOSSY, 0.009, 0.25, 0.5)
    assert stack.receive(2000)["retransmission"] == 750_000  # a quarter of the period
    assert stack.draws.numbers == []


@pytest.mark.parametrize(("draws", "comes"), [((0.009,), False), ((0.01, 0.09), False), ((0.01, 0.1), True)])
def test_with_best_effort_a_large_message_of_which_a_fragment_is_lost_never_comes(
    draws: tuple[float, ...], comes: bool
) -> None:
    stack = Stack(LOSSY, *draws)
    end = start(stack.environment, stack.steps_of_best_effort(2000))
    assert stack.environment.run(until=end) is comes
    assert stack.environment.now == 4500 + 10_100  # nobody sends it again
    assert stack.draws.numbers == []


def test_what_the_board_sends_is_not_lost() -> None:
    stack = Stack(LOSSY)
    assert stack.send(2000) == {"dds": 8_100, "transport": 4500}


def test_what_comes_while_all_cores_are_busy_is_lost_more_often() -> None:
    stack = Stack(LOSSY, 0.29, 0.5, 0.9)
    start(stack.environment, stack.cpu.run(100_000))
    assert stack.receive(2000)["retransmission"] == 1_500_000
    assert "retransmission" not in Stack(LOSSY, 0.29, 0.9).receive(2000)


def test_what_comes_while_the_stack_is_stalled_is_lost_more_often() -> None:
    stack = Stack(LOSSY, 0.29, 0.5, 0.9)
    stack.cpu.stall_stack()
    stack.environment.call_later(5000, stack.cpu.resume_stack)
    assert stack.receive(2000)["retransmission"] == 1_500_000


def test_a_small_message_is_never_lost() -> None:
    stack = Stack(LOSSY, 0.0)
    assert "retransmission" not in stack.receive(1000)
    assert stack.draws.numbers == [0.0]


def test_times_in_the_stack_vary_by_the_jitter() -> None:
    stack = Stack(small_profile(**COSTS, jitter=0.07))  # type: ignore[arg-type] # as above
    assert stack.receive(8)["dds"] == 1.5 * 124
    assert stack.draws.deviations == [(0, 0.07)]


def test_the_stack_takes_its_share_of_a_core_from_a_thread() -> None:
    stack = Stack(small_profile(**COSTS, core_share=0.4))  # type: ignore[arg-type] # as above
    thread = start(stack.environment, stack.cpu.run(1000))
    assert stack.receive(0) == {"transport": 500, "dds": 100}
    stack.environment.run(until=thread)
    assert stack.environment.now == 1000 + 40


def test_a_stalled_stack_keeps_messages_waiting() -> None:
    stack = Stack()
    stack.cpu.stall_stack()
    stack.environment.call_later(5000, stack.cpu.resume_stack)
    assert stack.receive(8) == {"transport": 516, "dds": 5000 - 516 + 124}


def test_what_the_message_spent_in_the_real_network_is_not_waited_for_again() -> None:
    stack = Stack()
    assert stack.receive(8, transit_ns=300)["transport"] == 516
    assert stack.environment.now == 216 + 124


def test_a_message_that_took_longer_than_the_modelled_link_is_not_delayed() -> None:
    stack = Stack()
    assert stack.receive(8, transit_ns=2000)["transport"] == 2000
    assert stack.environment.now == 124


def test_a_sender_whose_clock_is_ahead_does_not_lengthen_the_link() -> None:
    stack = Stack()
    timeline, end = stack.begin("message", "in", 8, transit_ns=-400)
    stack.environment.run(until=end)
    assert stack.log == [(516 + 124, "message")]
    assert (stages(timeline), timeline.age_ns) == ({"transport": 516, "dds": 124}, 516 + 124)


def test_what_the_board_sends_leaves_earlier_by_what_messages_lately_took_in_the_real_network() -> None:
    stack = Stack()
    for _ in range(100):
        stack.receive(8, transit_ns=200)
    assert stack.send(8) == {"dds": 124, "transport": 516 - 200}
    # Large ones are another matter.
    stack.draws.numbers = [1.0, 1.0]
    assert stack.send(2000)["transport"] == 4500


def test_one_message_that_was_long_in_the_real_network_is_taken_for_an_eighth() -> None:
    stack = Stack()
    stack.receive(8, transit_ns=400)
    assert stack.send(8)["transport"] == 516 - 400 // 8


def test_no_message_is_expected_to_take_longer_in_the_real_network_than_over_the_link() -> None:
    stack = Stack()
    for _ in range(200):
        stack.receive(8, transit_ns=100_000)
    assert stack.send(8) == {"dds": 124}


@pytest.mark.parametrize("direction", ["receive", "send"])
def test_without_a_model_a_message_costs_nothing(direction: str) -> None:
    stack = Stack(NATIVE)
    assert getattr(stack, direction)(1_000_000) == {}
    assert stack.environment.now == 0


def test_without_a_model_the_time_in_the_real_network_is_accounted_for() -> None:
    assert Stack(NATIVE).receive(8, transit_ns=700) == {"transport": 700}


def test_without_a_model_what_a_message_waited_to_be_sent_is_accounted_for() -> None:
    stack = Stack(NATIVE)
    timeline = Timeline(stack.environment, 0)
    stack.environment.run(until=50)
    stack.environment.run(until=start(stack.environment, stack._stack.send(8, timeline)))
    assert stages(timeline) == {"dds": 50}
