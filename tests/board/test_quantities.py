"""Quantities: units, and what is no quantity."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from reconros_zenoh.board.quantity import (
    Bandwidth,
    CostPerByte,
    Count,
    Duration,
    Fraction,
    Frequency,
    Quantity,
    Share,
    Size,
)


def of(kind: type[Quantity], value: object, unit: str) -> Any:
    return kind.model_validate({"value": value, "unit": unit, "basis": "assumed"})


@pytest.mark.parametrize(("unit", "ns"), [("ns", 2), ("us", 2250), ("ms", 2_250_000), ("s", 2_250_000_000)])
def test_durations_are_whole_nanoseconds(unit: str, ns: int) -> None:
    assert of(Duration, 2.25, unit).ns == ns
    assert isinstance(of(Duration, 2.25, unit).ns, int)


@pytest.mark.parametrize("unit", ["ns/B", "us/kB", "ms/MB"])
def test_costs_per_byte(unit: str) -> None:
    assert of(CostPerByte, 45.5, unit).ns_per_byte == 45.5


@pytest.mark.parametrize(
    ("unit", "bytes_per_ns"), [("B/s", 4e-7), ("kB/s", 4e-4), ("MB/s", 0.4), ("GB/s", 400)]
)
def test_bandwidths(unit: str, bytes_per_ns: float) -> None:
    assert of(Bandwidth, 400, unit).bytes_per_ns == pytest.approx(bytes_per_ns, rel=1e-15)


@pytest.mark.parametrize(("unit", "hz"), [("Hz", 120), ("kHz", 120e3), ("MHz", 120e6), ("GHz", 120e9)])
def test_frequencies(unit: str, hz: float) -> None:
    assert of(Frequency, 120, unit).hz == hz


@pytest.mark.parametrize(
    ("unit", "size"), [("B", 64), ("kB", 64_000), ("KiB", 65_536), ("MB", 64_000_000), ("MiB", 67_108_864)]
)
def test_sizes_are_whole_bytes(unit: str, size: int) -> None:
    assert of(Size, 64, unit).bytes == size
    assert isinstance(of(Size, 64, unit).bytes, int)


def test_fractions_and_counts_have_the_unit_one() -> None:
    assert of(Fraction, 0.13, "1").share == 0.13
    assert of(Count, 2, "1").value == 2


@pytest.mark.parametrize(
    ("kind", "value", "unit"),
    [
        (Duration, 0, "ms"),
        (CostPerByte, 0, "ns/B"),
        (Size, 0, "B"),
        (Fraction, 0, "1"),
        (Fraction, 1, "1"),
        (Share, 0.001, "1"),
        (Share, 1, "1"),
        (Count, 1, "1"),
        (Bandwidth, 0.001, "B/s"),
        (Frequency, 0.001, "Hz"),
    ],
)
def test_the_smallest_and_the_largest(kind: type[Quantity], value: float, unit: str) -> None:
    assert of(kind, value, unit).value == value


@pytest.mark.parametrize(
    ("kind", "value", "unit"),
    [
        (Duration, -1, "ms"),
        (Duration, float("nan"), "ms"),
        (Duration, float("inf"), "ms"),
        (Duration, "soon", "ms"),
        (Bandwidth, 0, "MB/s"),
        (Bandwidth, float("inf"), "MB/s"),
        (Frequency, 0, "MHz"),
        (Fraction, 1.01, "1"),
        (Fraction, -0.01, "1"),
        (Share, 0, "1"),
        (Share, 1.01, "1"),
        (Count, 0, "1"),
        (Count, 1.5, "1"),
        (Count, 10**4000, "1"),
        (Duration, 1e308, "s"),
        (Size, 1e308, "MiB"),
    ],
)
def test_values_that_cannot_be(kind: type[Quantity], value: object, unit: str) -> None:
    with pytest.raises(ValidationError, match="value"):
        of(kind, value, unit)


@pytest.mark.parametrize(
    ("kind", "unit", "known"),
    [
        (Duration, "min", "ns, us, ms, s"),
        (CostPerByte, "ms", "ns/B, us/kB, ms/MB"),
        (Bandwidth, "Mbit/s", "B/s, kB/s, MB/s, GB/s"),
        (Frequency, "mhz", "Hz, kHz, MHz, GHz"),
        (Size, "KB", "B, kB, KiB, MB, MiB"),
        (Fraction, "%", "1"),
        (Count, "", "1"),
    ],
)
def test_a_unit_that_does_not_fit_names_those_that_do(kind: type[Quantity], unit: str, known: str) -> None:
    with pytest.raises(ValidationError, match=f"unknown unit '{unit}': write one of {known}"):
        of(kind, 1, unit)


@pytest.mark.parametrize("key", ["value", "unit", "basis"])
def test_value_unit_and_basis_are_required(key: str) -> None:
    fields = {"value": 1, "unit": "ms", "basis": "assumed"}
    del fields[key]
    with pytest.raises(ValidationError, match=key):
        Duration.model_validate(fields)


def test_a_quantity_has_no_other_keys_and_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="units"):
        Duration.model_validate({"value": 1, "unit": "ms", "basis": "assumed", "units": "ms"})
    with pytest.raises(ValidationError, match="frozen"):
        of(Duration, 1, "ms").value = 2


def test_the_basis_is_one_of_three_and_a_source_may_be_given() -> None:
    for basis in ("published", "calibrated", "assumed"):
        fields = {"value": 1, "unit": "ms", "basis": basis, "source": "Table I"}
        assert Duration.model_validate(fields).model_dump() == fields
    with pytest.raises(ValidationError, match="'published', 'calibrated' or 'assumed'"):
        Duration.model_validate({"value": 1, "unit": "ms", "basis": "guessed"})
