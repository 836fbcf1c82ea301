"""The cost model meets the text of Mapping and Optimizing, Section 4, and decides by it."""

from __future__ import annotations

import pytest

from reconros_zenoh.mapping.communication import TopicMapping
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.mapping.predict import (
    TransferCosts,
    transfer_times,
)

BYTES_PER_NS = 0.346
UNIT_NS = 10_000 / BYTES_PER_NS
ZCU104 = TransferCosts(
    publish_ns=6.12 * UNIT_NS,
    notify_hardware_ns=0.25 * UNIT_NS,
    notify_software_ns=0.221 * UNIT_NS,
    copy_in_ns_per_byte=1.509 / BYTES_PER_NS,
    copy_out_ns_per_byte=0.266 / BYTES_PER_NS,
    cancel_ns=7.87 * UNIT_NS,
    hmt_overhead_ns=7.31 * UNIT_NS,
    hmt_bytes_per_ns=BYTES_PER_NS,
    memif_bytes_per_ns=BYTES_PER_NS,
)
SIZES = (10_000, 100_000, 1_000_000, 10_000_000)
READERS = (2, 4, 8)
SOFTWARE, HARDWARE, GATEWAY = TopicMapping


def speedups(publisher: Side, size: int, readers: int) -> tuple[float, float]:
    """Return how much faster the gateway is: to the slowest subscriber in hardware, to that in software."""
    smt, gateway = (
        transfer_times(ZCU104, mapping, publisher, size, readers) for mapping in (SOFTWARE, GATEWAY)
    )
    return smt.hardware_ns / gateway.hardware_ns, smt.software_ns / gateway.software_ns


def test_the_speedups_of_the_text() -> None:
    assert speedups(Side.HARDWARE, 10_000, 8)[0] == pytest.approx(1.94, rel=0.01)
    assert speedups(Side.HARDWARE, 10_000_000, 8)[0] == pytest.approx(7.95, rel=0.01)
    assert speedups(Side.HARDWARE, 10_000, 2)[1] == pytest.approx(0.5, rel=0.01)
    assert speedups(Side.HARDWARE, 10_000_000, 8)[1] == pytest.approx(1, rel=0.01)
    assert speedups(Side.SOFTWARE, 10_000, 2)[0] < 1
    largest = max(speedups(Side.SOFTWARE, size, readers)[0] for size in SIZES for readers in READERS)
    assert largest == pytest.approx(3.79, rel=0.01)
    to_software = [speedups(Side.SOFTWARE, size, readers)[1] for size in SIZES for readers in READERS]
    assert min(to_software) == pytest.approx(1.06, rel=0.02)
    assert max(to_software) == pytest.approx(2.05, rel=0.01)


def test_gateway_and_stream_work_at_the_pace_of_the_slower_one() -> None:
    fast_stream = TransferCosts(0, 0, 0, 0, 0, 0, 0, hmt_bytes_per_ns=4, memif_bytes_per_ns=1)
    assert transfer_times(fast_stream, GATEWAY, Side.HARDWARE, 100, 2) == (25, 100)
    assert transfer_times(fast_stream, GATEWAY, Side.SOFTWARE, 100, 2) == (100, 0)
