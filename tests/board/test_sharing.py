"""Processor sharing: who gets how much of a shared resource, and when each job is done."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from small_board import start

from reconros_zenoh.board.sharing import SharedResource
from reconros_zenoh.clock.virtual import VirtualEnvironment

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from small_board import Steps


class Job(NamedTuple):
    arrives_ns: int
    work: float
    first: bool = False
    limit: float | None = None


class Hold(NamedTuple):
    begins_ns: int
    ends_ns: int


def ends(
    jobs: Sequence[Job], holds: Sequence[Hold] = (), *, capacity: float = 1, per_job: float = 1
) -> list[int]:
    """When each job is done [ns]."""
    environment = VirtualEnvironment()
    resource = SharedResource(environment, capacity, per_job)
    done: dict[int, int] = {}

    def hold(hold: Hold) -> Steps:
        yield environment.timeout(hold.begins_ns)
        resource.hold_first()
        yield environment.timeout(hold.ends_ns - hold.begins_ns)
        resource.release_first()

    def run(index: int, job: Job) -> Steps:
        yield environment.timeout(job.arrives_ns)
        yield from resource.serve(job.work, job.limit, first=job.first)
        done[index] = environment.now

    for each in holds:
        start(environment, hold(each))
    for index, job in enumerate(jobs):
        start(environment, run(index, job))
    environment.run()
    return [done[index] for index in range(len(jobs))]


def test_a_job_alone_takes_as_long_as_its_work() -> None:
    assert ends([Job(5, 100)]) == [105]


def test_a_job_alone_on_two_cores_uses_one_of_them() -> None:
    assert ends([Job(0, 100)], capacity=2) == [100]


def test_no_work_is_done_at_once() -> None:
    assert ends([Job(0, 100), Job(10, 0), Job(10, -1)]) == [100, 10, 10]


def test_the_least_work_takes_a_nanosecond() -> None:
    assert ends([Job(0, 1)]) == [1]
    assert ends([Job(0, 0.001)]) == [1]


def test_two_equal_jobs_on_one_core_take_twice_as_long() -> None:
    assert ends([Job(0, 100), Job(0, 100)]) == [200, 200]


def test_a_short_job_leaves_the_core_to_the_long_one() -> None:
    assert ends([Job(0, 100), Job(0, 300)]) == [200, 400]


def test_a_late_job_shares_from_its_arrival() -> None:
    # 0..50 the first alone; 50..150 both at half speed; 150..200 the second alone
    assert ends([Job(0, 100), Job(50, 100)]) == [150, 200]


def test_three_jobs_share_two_cores() -> None:
    assert ends([Job(0, 100)] * 3, capacity=2) == [150] * 3


def test_a_bus_gives_one_job_all_it_has() -> None:
    # 0.4 bytes per nanosecond
    assert ends([Job(0, 400)], capacity=0.4, per_job=0.4) == [1000]
    assert ends([Job(0, 400), Job(0, 400)], capacity=0.4, per_job=0.4) == [2000, 2000]


def test_a_part_of_a_nanosecond_counts_as_a_whole_one() -> None:
    assert ends([Job(0, 10.25)]) == [11]


def test_first_jobs_take_the_core_from_others() -> None:
    assert ends([Job(0, 100), Job(50, 30, first=True)]) == [130, 80]


def test_first_jobs_share_among_themselves_and_others_get_what_is_left() -> None:
    # Two cores: one for the stack's job, one for two threads.
    assert ends([Job(0, 100, first=True), Job(0, 100), Job(0, 100)], capacity=2) == [100, 150, 150]
    assert ends([Job(0, 100, first=True)] * 3 + [Job(0, 100)], capacity=2) == [150, 150, 150, 250]


def test_a_job_gets_no_more_than_its_limit() -> None:
    assert ends([Job(0, 100, limit=0.4)]) == [250]


def test_what_a_limited_job_leaves_goes_to_others() -> None:
    # 0.25 to the first; the second has 0.75 until 100 and then the whole core.
    assert ends([Job(0, 25, limit=0.25), Job(0, 175)]) == [100, 200]
    assert ends([Job(0, 25, first=True, limit=0.25), Job(0, 175)]) == [100, 200]


def test_a_limit_above_an_equal_share_does_not_matter() -> None:
    assert ends([Job(0, 100, limit=0.9), Job(0, 100), Job(0, 100)]) == [300] * 3


def test_held_first_jobs_wait_and_leave_the_core_to_others() -> None:
    assert ends([Job(0, 100, first=True), Job(0, 100)], [Hold(40, 1000)]) == [1060, 140]


def test_holds_count() -> None:
    assert ends([Job(0, 100, first=True)], [Hold(10, 500), Hold(20, 300)]) == [590]


def test_a_first_job_that_arrives_in_a_hold_waits_for_its_end() -> None:
    assert ends([Job(50, 100, first=True)], [Hold(0, 300)]) == [400]


def test_work_that_is_done_when_a_first_job_arrives_does_not_wait_for_it() -> None:
    # The first job arrives in the very nanosecond in which the other is through.
    assert ends([Job(0, 100, first=True), Job(100, 500, first=True)]) == [100, 600]
    assert ends([Job(100, 500, first=True), Job(0, 100)]) == [600, 100]


def test_work_that_is_done_when_a_hold_begins_does_not_wait_for_its_end() -> None:
    assert ends([Job(0, 100, first=True)], [Hold(100, 900)]) == [100]


times = st.integers(0, 60) | st.integers(0, 3000)
works = st.integers(0, 60) | st.integers(0, 2000) | st.floats(0, 2000, allow_subnormal=False)
machines = st.sampled_from([(1, 1), (2, 1), (3, 1), (0.4, 0.4), (2.5, 0.75), (1, 3)])
limits = st.sampled_from([None, 0.25, 0.3])
any_jobs = st.lists(st.builds(Job, times, works, st.booleans(), limits), min_size=1, max_size=8)
equal_jobs = st.lists(st.builds(Job, times, works, st.just(value=False), st.none()), min_size=1, max_size=8)
any_holds = st.lists(st.tuples(times, times).map(lambda pair: Hold(min(pair), max(pair))), max_size=3)


def max_min_fair(limits: Mapping[int, Fraction], capacity: Fraction) -> dict[int, Fraction]:
    """What each job gets when all rates grow alike until a job has its limit or nothing is left."""
    rates = dict.fromkeys(limits, Fraction(0))
    growing = set(limits)
    while growing and capacity > 0:
        step = min(capacity / len(growing), *(limits[i] - rates[i] for i in growing))
        for i in growing:
            rates[i] += step
        capacity -= step * len(growing)
        growing = {i for i in growing if rates[i] < limits[i]}
    return rates


@example([Job(0, 2, True, None)] * 5, [], (0.4, 0.4))  # a fifth of 0.4 is rounded
@given(any_jobs, any_holds, machines)
def test_every_job_gets_its_fair_share_until_its_work_is_done_and_no_longer(
    jobs: list[Job], holds: list[Hold], machine: tuple[float, float]
) -> None:
    """Adds up, in exact fractions, what each job must have got while it was there."""
    capacity, per_job = machine
    done_ns = ends(jobs, holds, capacity=capacity, per_job=per_job)

    def is_there(i: int, now_ns: int) -> bool:
        return jobs[i].arrives_ns <= now_ns < done_ns[i]

    left = [Fraction(job.work) for job in jobs]
    rate = [Fraction(0)] * len(jobs)
    instants = (
        {job.arrives_ns for job in jobs} | set(done_ns) | {instant for hold in holds for instant in hold}
    )
    for now_ns, next_ns in pairwise(sorted(instants)):
        held = any(begin <= now_ns < end for begin, end in holds)
        present = {i: Fraction(job.limit or per_job) for i, job in enumerate(jobs) if is_there(i, now_ns)}
        first = {i: limit for i, limit in present.items() if jobs[i].first}
        others = {i: limit for i, limit in present.items() if not jobs[i].first}
        now_first = dict.fromkeys(first, Fraction(0)) if held else max_min_fair(first, Fraction(capacity))
        now = now_first | max_min_fair(others, Fraction(capacity) - sum(now_first.values()))
        for i in present:
            assert left[i] > 0, "nobody stays whose work is done"
            rate[i] = now[i]
            left[i] -= rate[i] * (next_ns - now_ns)
    for i, job in enumerate(jobs):
        assert left[i] < 1e-6, "done means that nothing is left"
        assert left[i] > -rate[i] - Fraction(1, 10**6), "and that less than a nanosecond ago something was"
        assert job.work > 0 or done_ns[i] == job.arrives_ns


def processor_sharing(jobs: Sequence[Job], capacity: Fraction, per_job: Fraction) -> list[Fraction]:
    """When each of several equal jobs is done, exactly: in attained service, the clock of processor sharing.

    All jobs present attain service at one speed, so a job leaves when the common attained service has grown
    by its work since it arrived.
    """
    done = [Fraction(job.arrives_ns) for job in jobs]
    arrivals = sorted((job.arrives_ns, index) for index, job in enumerate(jobs) if job.work > 0)
    leaves: dict[int, Fraction] = {}  # the attained service at which it leaves
    now = attained = Fraction(0)
    while arrivals or leaves:
        speed = min(per_job, capacity / len(leaves)) if leaves else Fraction(0)
        next_leave = now + (min(leaves.values()) - attained) / speed if leaves else None
        if next_leave is None or (arrivals and arrivals[0][0] <= next_leave):
            arrives_ns, index = arrivals.pop(0)
            attained += speed * (arrives_ns - now)
            now = Fraction(arrives_ns)
            leaves[index] = attained + Fraction(jobs[index].work)
        else:
            attained += speed * (next_leave - now)
            now = next_leave
            for index in [i for i, service in leaves.items() if service <= attained]:
                done[index] = now
                del leaves[index]
    return done


@given(equal_jobs, machines)
def test_jobs_end_when_processor_sharing_says_so(jobs: list[Job], machine: tuple[float, float]) -> None:
    exact = processor_sharing(jobs, *map(Fraction, machine))
    got = ends(jobs, capacity=machine[0], per_job=machine[1])
    # Each end is a whole nanosecond; the rounding of one job's end may cost another one that runs n times
    # slower n nanoseconds.
    allowed_ns = len(jobs) ** 2
    for job, exact_ns, got_ns in zip(jobs, exact, got, strict=True):
        assert abs(got_ns - exact_ns) < allowed_ns, job


@given(st.lists(st.integers(1, 10**9), min_size=1, max_size=10))
def test_jobs_that_come_together_on_one_core(works: list[int]) -> None:
    """The closed form: while k jobs are left, each step of work takes k times as long."""
    exact_ns, order = 0, sorted(range(len(works)), key=works.__getitem__)
    expected = dict.fromkeys(order, 0)
    for place, (shorter, longer) in enumerate(pairwise([0, *(works[i] for i in order)])):
        exact_ns += (longer - shorter) * (len(works) - place)
        expected[order[place]] = exact_ns
    got = ends([Job(0, work) for work in works])
    for index, end_ns in expected.items():
        assert abs(got[index] - end_ns) <= len(works)


@given(st.lists(st.builds(Job, times, works, st.booleans(), st.none()), min_size=1, max_size=8), machines)
def test_without_holds_the_last_job_ends_when_all_work_is_done(
    jobs: list[Job], machine: tuple[float, float]
) -> None:
    """One job at a time can use a whole bus: then the order does not matter to the end of the last."""
    capacity = Fraction(machine[0])
    backlog_ends = Fraction(0)
    for job in sorted(jobs):
        if job.work > 0:
            backlog_ends = max(backlog_ends, Fraction(job.arrives_ns)) + Fraction(job.work) / capacity
    last_ends = max(backlog_ends, *(Fraction(job.arrives_ns) for job in jobs))
    got = max(ends(jobs, capacity=float(capacity), per_job=float(capacity)))
    assert abs(got - last_ends) <= len(jobs) + 1


@pytest.mark.parametrize("stop", [lambda job: job.throw(ValueError), lambda job: job.close()])
def test_a_job_that_is_stopped_leaves_its_share_to_the_others(stop: Callable[[Steps], object]) -> None:
    environment = VirtualEnvironment()
    resource = SharedResource(environment, capacity=1, per_job=1)
    stopped = resource.serve(1000)
    next(stopped)
    end = start(environment, resource.serve(100))
    environment.run(until=20)
    with suppress(ValueError):
        stop(stopped)
    environment.run(until=end)
    # 10 of its 100 units are done after 20 ns together, the other 90 alone.
    assert environment.now == 110


@given(st.lists(st.builds(Job, st.integers(0, 50), st.integers(0, 40)), max_size=8), st.integers(1, 400))
def test_what_has_been_done_is_never_more_than_could_be_and_in_the_end_what_was_asked_for(
    jobs: list[Job], until_ns: int
) -> None:
    environment = VirtualEnvironment()
    resource = SharedResource(environment, 2, 1)

    def run(job: Job) -> Steps:
        yield environment.timeout(job.arrives_ns)
        yield from resource.serve(job.work)

    for job in jobs:
        start(environment, run(job))
    environment.run(until=until_ns)
    assert -1e-9 <= resource.use(until_ns) <= 1 + 1e-9
    environment.run(until=1000)
    assert resource.use(1000) * 2000 == pytest.approx(sum(job.work for job in jobs))


def test_of_a_job_that_is_given_up_only_what_was_done_counts() -> None:
    environment = VirtualEnvironment()
    resource = SharedResource(environment, 2, 1)
    steps = resource.serve(100)
    next(steps)
    environment.run(until=40)
    steps.close()
    environment.run(until=80)
    assert resource.use(80) == 40 / 160
