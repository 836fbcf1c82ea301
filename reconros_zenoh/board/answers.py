"""What a board answers, as it must look: anybody in the network can call itself a board."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

VERSION = 1
"""Rises with each field that is added, changed or taken away after the first release: all are required."""

# Names go to terminals, which obey what control characters say.
_Text = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)


class _Timing(_Part):
    basis: _Text


class _Call(_Part):
    slot: int | None
    since_ms: float
    waits_for: _Text | None


class _Callback(_Part):
    kind: _Text
    software: bool
    slots: list[int]
    timing: dict[_Text, _Timing]
    calls: int
    failed: int
    dropped: int
    running: list[_Call]


class _Slot(_Part):
    id: int
    holds: _Text | None
    reconfigurations: int
    reconfiguration_ms: float
    icap_wait_ms: float
    busy_ms: float


class _Use(_Part):
    cores: float
    icap: float
    memif: float
    stack: float


class _Publisher(_Part):
    sent: int
    dropped: int
    age_p50_ms: float | None
    age_p95_ms: float | None
    age_max_ms: float | None


class _Stream(_Part):
    passed: int
    dropped: int
    waits: int


class _Gateway(_Part):
    name: _Text
    hmt: _Text
    smt: _Text
    type: _Text
    qos: dict[_Text, _Text | int]
    slot: int
    to_hmt: int
    to_smt: int
    late: int
    dropped: int
    refused: int


class _Host(_Part):
    overruns: int
    overrun_ms: float
    lag_p50_us: float | None
    lag_p99_us: float | None
    real_time_priority: bool | None


class StatusAnswer(_Part):
    """What `reconros/<board>/status` answers, see `board.status`."""

    version: int
    board: _Text
    profile: _Text
    domain: int
    executor: _Text
    elapsed_ms: float
    callbacks: dict[_Text, _Callback]
    slots: list[_Slot]
    use: _Use | None
    publishers: dict[_Text, _Publisher]
    gateways: list[_Gateway]
    hmt: dict[_Text, _Stream]
    spans_ms: dict[_Text, dict[_Text, float]]
    rejected: dict[_Text, int]
    host: _Host


class GatewayAnswer(_Part):
    """What `reconros/<board>/gateway` answers.

    `refused` says why none was added, `warning` what is odd about the one that was.
    """

    version: int
    gateways: list[_Gateway]
    refused: str | None
    warning: str | None
