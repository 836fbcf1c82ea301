"""The rules of healthchecks, in virtual time."""

from __future__ import annotations

from deploy.compose import Healthcheck
from deploy.health import Health

RULES = Healthcheck(("check",), interval_ns=10, timeout_ns=5, retries=3, start_period_ns=100)


def test_first_check_comes_one_interval_after_the_start() -> None:
    assert Health(RULES, started_ns=1000).next_check_ns == 1010


def test_next_check_comes_one_interval_after_the_end_of_the_last() -> None:
    health = Health(RULES, started_ns=1000)
    health.record(passed=False, began_ns=1010, ended_ns=1013)
    assert health.next_check_ns == 1023


def test_failures_within_the_start_period_do_not_count() -> None:
    health = Health(RULES, started_ns=1000)
    for began_ns in (1010, 1050, 1099, 1100, 1110):
        health.record(passed=False, began_ns=began_ns, ended_ns=began_ns)
    assert not health.unhealthy
    health.record(passed=False, began_ns=1120, ended_ns=1120)
    assert health.unhealthy
    assert not health.healthy


def test_success_within_the_start_period_counts() -> None:
    health = Health(RULES, started_ns=1000)
    health.record(passed=False, began_ns=1010, ended_ns=1011)
    health.record(passed=True, began_ns=1021, ended_ns=1022)
    assert health.healthy
    assert not health.unhealthy
