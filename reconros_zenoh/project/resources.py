"""What a reconfigurable slot holds, counted from its regions."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from reconros_zenoh.project.regions import Region
    from reconros_zenoh.project.slots import HwSlot

_LUTS_PER_SLICE = 4
# UltraScale+ slices hold twice as many LUTs (UG574). Site types that only this family has give it away.
_LUTS_PER_ULTRASCALE_SLICE = 8
_ULTRASCALE_SITES = ("DSP48E2", "URAM288", "CLE")


@dataclass(frozen=True)
class SlotResources:
    """Resources of one slot: look-up tables, DSP slices, block RAMs of 36 kbit and of 18 kbit.

    `bram36` and `bram18` are two views of the same memory: a site holds one of 36 kbit or two of 18 kbit.
    """

    lut: int
    dsp: int
    bram36: int
    bram18: int


def slot_resources(regions: Iterable[Region]) -> SlotResources:
    """Return the resources inside the regions of one slot (ReconROS Executor, Section V-B, Table II).

    The BRAM columns of Table II are swapped in print for RS #2 and RS #3 ("240 / 120", "200 / 100"): the
    RAMB36 sites of their regions are 120 and 100, so the counts here are 120 / 240 and 100 / 200. Site types
    other than SLICE, DSP48, RAMB36 and RAMB18 are not counted.
    """
    regions = tuple(regions)
    return _count(regions, ultrascale=_is_ultrascale(regions))


def resources_by_slot(slots: Collection[HwSlot]) -> Mapping[int, SlotResources]:
    """Return the resources of the slots of one device by id; one of them gives the family of all away."""
    ultrascale = any(_is_ultrascale(slot.regions) for slot in slots)
    return {slot.id: _count(slot.regions, ultrascale=ultrascale) for slot in slots}


def _is_ultrascale(regions: Iterable[Region]) -> bool:
    return any(region.site.startswith(_ULTRASCALE_SITES) for region in regions)


def _count(regions: Iterable[Region], *, ultrascale: bool) -> SlotResources:
    sites: Counter[str] = Counter()
    for region in regions:
        sites[region.site] += region.sites
    return SlotResources(
        lut=sites["SLICE"] * (_LUTS_PER_ULTRASCALE_SLICE if ultrascale else _LUTS_PER_SLICE),
        dsp=sites["DSP48"] + sites["DSP48E2"],
        bram36=sites["RAMB36"],
        # RAMB18 ranges cover the columns of the RAMB36 ranges once more.
        bram18=sites["RAMB18"] or 2 * sites["RAMB36"],
    )
