"""How the wall clock waits and how late it says it was, in a time that the test makes."""

from __future__ import annotations

from dataclasses import astuple

import pytest
from made_up_time import MS, US, YIELD, MadeUpTime

from reconros_zenoh.clock import wall
from reconros_zenoh.clock.alarm import Alarm
from reconros_zenoh.clock.wall import Lag, WallEnvironment


class Sleep(Alarm):
    """A sleep that nothing ends early, but the first is off by some time, or all are."""

    def __init__(self, made_up: MadeUpTime, off_ns: int, *, always: bool = False) -> None:
        super().__init__()
        self._time = made_up
        self._off_ns = off_ns
        self._always = always
        self.lengths_ns: list[int] = []

    def wait(self, timeout_s: float) -> bool:
        length_ns = round(timeout_s * 1e9)
        self.lengths_ns.append(length_ns)
        self._time.now_ns += length_ns + self._off_ns
        if not self._always:
            self._off_ns = 0
        return False


def run_late(environment: WallEnvironment, *delays_ns: int) -> None:
    """Let something happen at these times, all passed already."""
    for delay in delays_ns:
        environment.call_later(delay, lambda: None)
    environment.run(until=environment.timeout(max(delays_ns)))


def test_a_loop_that_did_nothing_was_not_late() -> None:
    assert WallEnvironment().lag() == Lag(p50_us=0, p99_us=0)


def test_lag_is_the_start_of_an_event_minus_its_time(made_up: MadeUpTime) -> None:
    environment = WallEnvironment()
    made_up.now_ns = 3 * MS
    run_late(environment, 2_995 * US, 2_998 * US, 3_000 * US)
    assert astuple(environment.lag()) == pytest.approx((2, 4.94))


def test_lag_gives_percentiles_in_microseconds(made_up: MadeUpTime) -> None:
    environment = WallEnvironment()
    made_up.now_ns = MS
    run_late(environment, *(MS - late_us * US for late_us in range(1, 102)))
    assert astuple(environment.lag()) == pytest.approx((51, 100))


def test_events_of_one_time_have_one_lag_and_what_they_cause_at_that_time_has_none(
    made_up: MadeUpTime,
) -> None:
    environment = WallEnvironment()

    def cause() -> None:
        made_up.now_ns += 500 * US
        environment.timeout(0)

    made_up.now_ns = 10
    environment.call_later(4, cause)
    run_late(environment, 4, 4)
    assert astuple(environment.lag()) == pytest.approx((0.006, 0.006))


def test_a_slow_event_delays_the_start_of_the_next_but_not_its_time(made_up: MadeUpTime) -> None:
    environment = WallEnvironment()
    times: list[int] = []

    def slow() -> None:
        times.append(environment.now)
        made_up.now_ns += 5 * MS

    made_up.now_ns = MS
    environment.call_later(MS, slow)
    environment.call_later(2 * MS, lambda: times.append(environment.now))
    run_late(environment, 3 * MS)
    assert times == [MS, 2 * MS]
    assert environment.now == 3 * MS
    assert astuple(environment.lag()) == pytest.approx((3_000, 3_980))


def test_lag_forgets_all_but_the_last_events(made_up: MadeUpTime, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wall, "_LAGS_KEPT", 2)
    environment = WallEnvironment()
    made_up.now_ns = 10 * US
    run_late(environment, 1 * US, 8 * US, 10 * US)
    assert astuple(environment.lag()) == pytest.approx((1, 1.98))


def test_lag_can_begin_anew(made_up: MadeUpTime) -> None:
    environment = WallEnvironment()
    made_up.now_ns = 10 * US
    run_late(environment, 1 * US)
    environment.forget_lag()
    assert environment.lag() == Lag(0, 0)
    run_late(environment, 2 * US)
    assert astuple(environment.lag()) == pytest.approx((7, 7))


@pytest.mark.parametrize(("off_ns", "spins"), [(0, 4), (99 * US, 1), (150 * US, 0)])
def test_a_new_loop_sleeps_until_a_tenth_of_a_millisecond_before_an_event_and_spins_the_rest(
    made_up: MadeUpTime, off_ns: int, spins: int
) -> None:
    environment = WallEnvironment()
    sleep = environment._alarm = Sleep(made_up, off_ns)
    environment.run(until=environment.timeout(2 * MS))
    assert sleep.lengths_ns == [1_900 * US - YIELD]
    assert made_up.yields == 1 + spins
    assert environment.lag().p99_us == (made_up.now_ns - 2 * MS) / US >= 0


def test_a_sleep_that_ends_early_goes_on(made_up: MadeUpTime) -> None:
    environment = WallEnvironment()
    sleep = environment._alarm = Sleep(made_up, -MS)
    environment.run(until=environment.timeout(4 * MS))
    assert sleep.lengths_ns == pytest.approx([3_900 * US - YIELD, 1_000 * US - YIELD], rel=0.001)


def test_a_computation_that_has_the_core_before_a_sleep_does_not_make_that_end_late(
    made_up: MadeUpTime,
) -> None:
    environment = WallEnvironment()
    sleep = environment._alarm = Sleep(made_up, 0)
    made_up.next_yield_ns = 1_200 * US
    environment.run(until=environment.timeout(2 * MS))
    assert sleep.lengths_ns == [700 * US]


@pytest.mark.parametrize("off_us", [0, 40, 170, 400])
def test_the_loop_learns_how_late_its_sleeps_end(made_up: MadeUpTime, off_us: int) -> None:
    environment = WallEnvironment()
    sleep = environment._alarm = Sleep(made_up, off_us * US + 1, always=True)
    late = 0
    for number in range(1000):
        environment.run(until=environment.timeout(2 * MS))
        late += number >= 500 and made_up.yields == 1
        made_up.yields = 0
    assert late == pytest.approx(0 if off_us == 0 else 25, abs=2)
    # And no earlier than it must: the rest of a sleep that ends early is spun away.
    assert 2 * MS - YIELD - sleep.lengths_ns[-1] == pytest.approx(max(off_us, 20) * US, abs=40 * US)


def test_however_late_sleeps_end_the_loop_spins_half_a_millisecond_at_most(made_up: MadeUpTime) -> None:
    environment = WallEnvironment()
    environment._alarm = Sleep(made_up, MS, always=True)
    for _ in range(1000):
        environment.run(until=environment.timeout(2 * MS))
    assert environment.lag().p50_us == pytest.approx(500)


def test_a_call_whose_thread_was_held_up_while_it_posted_comes_now(made_up: MadeUpTime) -> None:
    environment = WallEnvironment()
    times: list[int] = []
    made_up.now_ns = 7
    run_late(environment, 5)
    made_up.now_ns = 3  # the moment at which that thread read the clock
    environment.post(lambda: times.append(environment.now))
    made_up.now_ns = 8
    run_late(environment, 1)
    assert times == [5]
