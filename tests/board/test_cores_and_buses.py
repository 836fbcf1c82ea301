"""Cores, memory interface and delegate: what they charge for, and who waits for whom."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from small_board import start

from reconros_zenoh.board.cpu import Cpu
from reconros_zenoh.board.memif import Memif
from reconros_zenoh.board.osif import Osif
from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    from collections.abc import Iterable

    from small_board import Steps


@pytest.fixture
def environment() -> VirtualEnvironment:
    return VirtualEnvironment()


def ends(environment: VirtualEnvironment, works: Iterable[Steps]) -> list[int]:
    """When each of these ends [ns] if all begin now."""
    done: dict[int, int] = {}

    def run(index: int, work: Steps) -> Steps:
        yield from work
        done[index] = environment.now

    for index, work in enumerate(works):
        start(environment, run(index, work))
    environment.run()
    return [done[index] for index in sorted(done)]


def test_a_thread_runs_on_one_core_even_if_others_are_free(environment: VirtualEnvironment) -> None:
    assert ends(environment, [Cpu(environment, 4).run(100)]) == [100]


def test_threads_run_on_one_core_each(environment: VirtualEnvironment) -> None:
    cpu = Cpu(environment, 2)
    assert ends(environment, [cpu.run(100), cpu.run(100)]) == [100, 100]


def test_more_threads_than_cores_share_them(environment: VirtualEnvironment) -> None:
    cpu = Cpu(environment, 2)
    assert ends(environment, [cpu.run(100), cpu.run(100), cpu.run(100), cpu.run(100)]) == [200] * 4


def test_the_communication_stack_comes_before_threads(environment: VirtualEnvironment) -> None:
    cpu = Cpu(environment, 1)
    assert ends(environment, [cpu.run(100), cpu.run_stack(30, share=1)]) == [130, 30]


def test_the_communication_stack_leaves_what_is_beyond_its_share_to_threads(
    environment: VirtualEnvironment,
) -> None:
    cpu = Cpu(environment, 1)
    # 40 % of the core for 100 ns; the thread gets 60 ns of them.
    assert ends(environment, [cpu.run(100), cpu.run_stack(40, share=0.4)]) == [140, 100]


def test_a_stalled_stack_leaves_the_cores_to_threads(environment: VirtualEnvironment) -> None:
    cpu = Cpu(environment, 1)
    cpu.stall_stack()
    environment.call_later(500, cpu.resume_stack)
    assert ends(environment, [cpu.run(100), cpu.run_stack(30, share=1)]) == [100, 530]


def test_a_transfer_takes_its_bytes_over_the_bandwidth(environment: VirtualEnvironment) -> None:
    memif = Memif(environment, 0.4)
    assert ends(environment, [memif.transfer(921_600)]) == [2_304_000]


def test_transfers_that_overlap_share_the_bandwidth(environment: VirtualEnvironment) -> None:
    memif = Memif(environment, 0.4)
    assert ends(environment, [memif.transfer(4000), memif.transfer(4000), memif.transfer(8000)]) == [
        30_000,
        30_000,
        40_000,
    ]


def test_a_memory_interface_that_is_not_modelled_takes_no_time(environment: VirtualEnvironment) -> None:
    memif = Memif(environment, None)
    assert ends(environment, [memif.transfer(921_600)]) == [0]


def test_a_call_takes_core_time_of_its_delegate(environment: VirtualEnvironment) -> None:
    cpu = Cpu(environment, 1)
    osif = Osif(cpu, 10)
    # The delegate is a thread like any other: it shares the core with a callback.
    assert ends(environment, [osif.call(), cpu.run(100)]) == [20, 110]
