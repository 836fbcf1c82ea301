"""Resources counted from regions: Table II of the paper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.project.ini import Option
from reconros_zenoh.project.regions import Region, read_regions
from reconros_zenoh.project.resources import SlotResources, resources_by_slot, slot_resources
from reconros_zenoh.project.slots import HwSlot

if TYPE_CHECKING:
    from collections.abc import Iterable

from pathlib import Path

numbers = st.integers(0, 300)
sizes = st.integers(1, 40)


def read(text: str) -> tuple[Region, ...]:
    return read_regions(Option(Path("build.cfg"), 1, "Region_0", text, (1,)))


def sites_of(regions: Iterable[Region]) -> set[tuple[str, int, int]]:
    return {
        (region.site, x, y)
        for region in regions
        for x in range(region.x0, region.x1 + 1)
        for y in range(region.y0, region.y1 + 1)
    }


# ReconROS Executor, Table II, with the BRAM columns of RS #2 and RS #3 the right way round.
@pytest.mark.parametrize(
    ("regions", "resources"),
    [
        (
            "SLICE_X0Y150:SLICE_X103Y199, DSP48_X0Y60:DSP48_X7Y79, RAMB36_X0Y30:RAMB36_X5Y39",
            SlotResources(20800, 160, 60, 120),
        ),
        (
            "SLICE_X0Y100:SLICE_X103Y149, DSP48_X0Y40:DSP48_X7Y59, RAMB36_X0Y20:RAMB36_X5Y29",
            SlotResources(20800, 160, 60, 120),
        ),
        (
            "SLICE_X0Y0:SLICE_X103Y99, DSP48_X0Y0:DSP48_X7Y39, RAMB36_X0Y0:RAMB36_X5Y19",
            SlotResources(41600, 320, 120, 240),
        ),
        (
            "SLICE_X104Y0:SLICE_X205Y99, DSP48_X8Y0:DSP48_X14Y39, RAMB36_X6Y0:RAMB36_X10Y19",
            SlotResources(40800, 280, 100, 200),
        ),
    ],
    ids=["RS #0", "RS #1", "RS #2", "RS #3"],
)
def test_the_slots_of_table_2(regions: str, resources: SlotResources) -> None:
    assert slot_resources(read(regions)) == resources


def test_block_rams_given_in_both_views_count_once() -> None:
    regions = read("RAMB18_X0Y60:RAMB18_X5Y79, RAMB36_X0Y30:RAMB36_X5Y39")
    assert slot_resources(regions) == SlotResources(0, 0, 60, 120)
    assert slot_resources(read("RAMB18_X0Y60:RAMB18_X0Y69")) == SlotResources(0, 0, 0, 10)


def test_an_ultrascale_slice_has_eight_luts() -> None:
    regions = read("SLICE_X0Y0:SLICE_X0Y9, DSP48E2_X0Y0:DSP48E2_X0Y2, URAM288_X0Y0:URAM288_X0Y3")
    assert slot_resources(regions) == SlotResources(80, 3, 0, 0)


def test_one_slot_gives_the_family_of_all_slots_of_the_device_away() -> None:
    regions = ("SLICE_X0Y0:SLICE_X0Y9", "SLICE_X1Y0:SLICE_X1Y4, DSP48E2_X0Y0:DSP48E2_X0Y2")
    slots = [
        HwSlot(number, f"slot({number})", None, True, read(text), None, 1)
        for number, text in enumerate(regions)
    ]
    assert resources_by_slot(slots) == {0: SlotResources(80, 0, 0, 0), 1: SlotResources(40, 3, 0, 0)}
    assert resources_by_slot(slots[:1]) == {0: SlotResources(40, 0, 0, 0)}


def test_no_regions() -> None:
    assert slot_resources(()) == SlotResources(0, 0, 0, 0)


@given(x=numbers, y=numbers, width=sizes, height=sizes, colon=st.sampled_from([":", "", " : "]))
def test_a_region_counts_its_sites(x: int, y: int, width: int, height: int, colon: str) -> None:
    [region] = read(f"SLICE_X{x}Y{y}{colon}SLICE_X{x + width - 1}Y{y + height - 1}")
    assert region.sites == len(sites_of([region])) == width * height
    assert slot_resources([region]).lut == 4 * width * height
    assert read(str(region)) == (region,)


rectangles = st.builds(
    lambda x, y, width, height: Region("SLICE", x, y, x + width, y + height),
    st.integers(0, 12),
    st.integers(0, 12),
    st.integers(0, 6),
    st.integers(0, 6),
)


@given(rectangles, rectangles)
def test_regions_overlap_if_they_share_a_site(one: Region, other: Region) -> None:
    assert one.overlaps(other) == bool(sites_of([one]) & sites_of([other]))
    assert one.overlaps(other) == other.overlaps(one)
