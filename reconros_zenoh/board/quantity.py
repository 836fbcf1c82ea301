"""A number of a profile with its unit and what it rests on."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Basis = Literal["published", "calibrated", "assumed"]
"""published: printed in a paper; calibrated: fitted to measurements; assumed: plausible, neither of these."""


class Quantity(BaseModel):
    """A value, its unit, its basis, and where it comes from."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    value: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    unit: str
    basis: Basis
    source: str = ""

    units: ClassVar[dict[str, float]] = {}
    largest: ClassVar[float] = 1e18
    """The most that is believed, in the first unit; of a time it is thirty years."""

    @model_validator(mode="after")
    def _unit_fits(self) -> Quantity:
        if self.unit not in self.units:
            raise ValueError(f"unknown unit {self.unit!r}: write one of {', '.join(self.units)}")
        if self._scaled > self.largest:
            raise ValueError(f"{self.value} {self.unit} is more than any board has")
        return self

    @property
    def _scaled(self) -> float:
        return self.value * self.units[self.unit]


class Duration(Quantity):
    """A time."""

    units: ClassVar[dict[str, float]] = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}

    @property
    def ns(self) -> int:
        """The time in whole nanoseconds."""
        return round(self._scaled)


class CostPerByte(Quantity):
    """A time per byte."""

    units: ClassVar[dict[str, float]] = {"ns/B": 1, "us/kB": 1, "ms/MB": 1}

    @property
    def ns_per_byte(self) -> float:
        """The time in nanoseconds per byte."""
        return self._scaled


class Bandwidth(Quantity):
    """Bytes per time; more than nothing."""

    value: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    units: ClassVar[dict[str, float]] = {"B/s": 1e-9, "kB/s": 1e-6, "MB/s": 1e-3, "GB/s": 1}

    @property
    def bytes_per_ns(self) -> float:
        """The bandwidth in bytes per nanosecond (GB/s)."""
        return self._scaled


class Frequency(Quantity):
    """A clock frequency; more than nothing."""

    value: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    units: ClassVar[dict[str, float]] = {"Hz": 1, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9}

    @property
    def hz(self) -> float:
        """The frequency in hertz."""
        return self._scaled


class Size(Quantity):
    """A number of bytes."""

    units: ClassVar[dict[str, float]] = {"B": 1, "kB": 1e3, "KiB": 1024, "MB": 1e6, "MiB": 1 << 20}
    largest: ClassVar[float] = 1e9

    @property
    def bytes(self) -> int:
        """The size in whole bytes."""
        return round(self._scaled)


class PositiveSize(Size):
    """A number of bytes; more than nothing."""

    value: Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Fraction(Quantity):
    """A share between 0 and 1."""

    value: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
    units: ClassVar[dict[str, float]] = {"1": 1}

    @property
    def share(self) -> float:
        """The share between 0 and 1."""
        return self._scaled


class Share(Fraction):
    """A share of more than nothing."""

    value: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)]


class RetryProbability(Fraction):
    """The probability that something has to be done once more; at 1 it would never end."""

    value: Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]


class Count(Quantity):
    """A whole number of things."""

    value: Annotated[int, Field(ge=1)]
    units: ClassVar[dict[str, float]] = {"1": 1}
    largest: ClassVar[float] = 1e6
