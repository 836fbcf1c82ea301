"""Link and communication stack: what a message costs between the network and the board's queues."""

from __future__ import annotations

import math
import random
from typing import TYPE_CHECKING

import pytest
from small_board import small_profile, stages, start

from reconros_zenoh.board.cpu import Cpu
from reconros_zenoh.board.dds import DdsStack
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.profile import Profile

PROFILE = small_profile(
    cores=1,
    link_ns=500,
    link_byte_ns=2,
    dds_message_ns=100,
    dds_byte_ns=3,
    dds_byte_large_ns=5,
    large_from=1000,
    nack_probability=0.1,
    nack_delay_ns=10_000,
    loss_probability=0.2,
    heartbeat_ns=1_000_000,
)


class Script(random.Random):
    """Draws the numbers it is given."""

    def __init__(self, *numbers: float) -> None:
        super().__init__()
        self.numbers = list(numbers)

    def random(self) -> float:
        return self.numbers.pop(0)

    def lognormvariate(self, mu: float = 0, sigma: float = 1) -> float:
        return math.exp(mu + sigma * self.random())


class Stack:
    """A stack whose steps are run one at a time."""

    def __init__(self, profile: Profile = PROFILE, *draws: float) -> None:
        self.environment = VirtualEnvironment()
        self.cpu = Cpu(self.environment, 1)
        self.draws = Script(*draws)
        self._stack = DdsStack(self.environment, self.cpu, profile.model, self.draws)

    def receive(self, size: int, transit_ns: int = 0) -> dict[str, int]:
        timeline = Timeline(self.environment, self.environment.now - transit_ns)
        return self._stages(self._stack.receive(size, transit_ns, timeline), timeline)

    def send(self, size: int) -> dict[str, int]:
        timeline = Timeline(self.environment, self.environment.now)
        return self._stages(self._stack.send(size, timeline), timeline)

    def _stages(self, step: Steps, timeline: Timeline) -> dict[str, int]:
        self.environment.run(until=start(self.environment, step))
        assert timeline.total_ns == self.environment.now - timeline.started_ns
        return stages(timeline)


def test_a_message_crosses_the_link_and_then_the_stack() -> None:
    assert Stack().receive(8) == {"transport": 500 + 8 * 2, "dds": 100 + 8 * 3}


def test_a_message_of_the_board_passes_the_stack_and_then_the_link() -> None:
    stack = Stack()
    assert stack.send(8) == {"dds": 124, "transport": 516}


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
    stack.environment.run(until=1)
    timeline = Timeline(stack.environment, 1)
    stack.environment.run(until=start(stack.environment, stack._stack.receive(8, -400, timeline)))
    assert stages(timeline) == {"transport": 516, "dds": 124}


def test_a_large_message_costs_more_per_byte() -> None:
    assert Stack(PROFILE).receive(1000)["dds"] == 100 + 1000 * 3
    assert Stack(PROFILE, 0.5, 0.5).receive(1001)["dds"] == 100 + 1001 * 5


def test_the_stack_works_on_a_fragment_while_the_next_ones_are_on_the_link() -> None:
    assert Stack(PROFILE, 0.5, 0.5).receive(2000) == {"transport": 500 + 1000 * 2, "dds": 100 + 2000 * 5}
    assert Stack(PROFILE, 0.5, 0.5).send(2000) == {"dds": 100 + 2000 * 5, "transport": 500 + 1000 * 2}


def test_a_link_slower_than_the_stack_decides() -> None:
    slow = small_profile(link_ns=500, link_byte_ns=20, dds_byte_large_ns=5, large_from=1000)
    assert sum(Stack(slow, 0.5, 0.5).receive(2000).values()) == 500 + 2000 * 20
    assert sum(Stack(slow, 0.5, 0.5).send(2000).values()) == 500 + 2000 * 20


def test_a_large_message_with_a_lost_fragment_is_sent_again_until_it_is_whole() -> None:
    stack = Stack(PROFILE, 0.5, 0.09, 0.0, 0.1)
    assert stack.receive(2000) == {
        "transport": 500 + 2000,
        "dds": 100 + 10_000,
        "retransmission": 2 * (10_000 + 100 + 10_000),
    }
    assert stack.draws.numbers == []


def test_what_the_board_sends_can_be_lost_too() -> None:
    assert Stack(PROFILE, 0.5, 0.05, 0.9).send(2000) == {
        "dds": 10_100,
        "retransmission": 10_000 + 10_100,
        "transport": 2500,
    }


def test_a_large_message_whose_resend_is_lost_too_waits_for_the_heartbeat() -> None:
    assert Stack(PROFILE, 0.19, 0.25, 0.9).receive(2000)["retransmission"] == 250_000


def test_a_small_message_waits_behind_a_large_one_of_another_node_and_direction() -> None:
    stack = Stack(PROFILE, 0.5, 0.5)
    large, small = (Timeline(stack.environment, 0) for _ in range(2))
    start(stack.environment, stack._stack.send(2000, large))
    stack.environment.run(until=start(stack.environment, stack._stack.receive(8, 0, small)))
    assert stages(small) == {"transport": 516, "dds": 10_100 - 516 + 124}


def test_a_stack_that_waits_for_the_network_half_the_time_leaves_half_a_core() -> None:
    stack = Stack(small_profile(dds_message_ns=100, core_share=0.5))
    thread = start(stack.environment, stack.cpu.run(200))
    assert stack.receive(0) == {"dds": 100}
    stack.environment.run(until=thread)
    assert stack.environment.now == 250


def test_the_times_of_the_stack_vary() -> None:
    profile = small_profile(dds_message_ns=1000, jitter=0.1)
    assert Stack(profile, 2.0).receive(0)["dds"] == math.ceil(1000 * math.exp(0.2))


def test_a_small_message_is_never_lost() -> None:
    stack = Stack(PROFILE, 0.0)
    assert "retransmission" not in stack.receive(1000)
    assert stack.draws.numbers == [0.0]


def test_the_stack_takes_the_core_from_a_thread() -> None:
    stack = Stack()
    thread = start(stack.environment, stack.cpu.run(1000))
    assert stack.receive(0) == {"transport": 500, "dds": 100}
    stack.environment.run(until=thread)
    assert stack.environment.now == 1100


@pytest.mark.parametrize("direction", ["receive", "send"])
def test_without_a_model_a_message_costs_nothing(direction: str) -> None:
    stack = Stack(small_profile().model_copy(update={"model": None}))
    assert getattr(stack, direction)(1_000_000) == {}
    assert stack.environment.now == 0


def test_without_a_model_the_time_in_the_real_network_is_accounted_for() -> None:
    stack = Stack(small_profile().model_copy(update={"model": None}))
    assert stack.receive(8, transit_ns=700) == {"transport": 700}


def test_without_a_model_what_a_message_waited_to_be_sent_is_accounted_for() -> None:
    stack = Stack(small_profile().model_copy(update={"model": None}))
    timeline = Timeline(stack.environment, 0)
    stack.environment.run(until=50)
    stack.environment.run(until=start(stack.environment, stack._stack.send(8, timeline)))
    assert stages(timeline) == {"dds": 50}
