"""Regions of the FPGA fabric, as Vivado's pblocks write them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reconros_zenoh.project.ini import Option

# The colon may be missing: Listing 1 of ReconROS Executor, Section IV, lost it in print. A pblock may hold a
# single site.
_RECTANGLE = re.compile(
    r"(?P<site>[A-Z][A-Z0-9_]*?)_X(?P<x0>[0-9]{1,9})Y(?P<y0>[0-9]{1,9})"
    r"(?:\s*:?\s*(?P=site)_X(?P<x1>[0-9]{1,9})Y(?P<y1>[0-9]{1,9}))?(?:[\s,]+|\Z)"
)


@dataclass(frozen=True)
class Region:
    """A rectangle of sites of one type; both corners belong to it, `x0 <= x1` and `y0 <= y1`.

    It stands in `line` of the project file.
    """

    site: str
    x0: int
    y0: int
    x1: int
    y1: int
    line: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"{self.site}_X{self.x0}Y{self.y0}:{self.site}_X{self.x1}Y{self.y1}"

    @property
    def sites(self) -> int:
        """How many sites lie in the rectangle."""
        return (self.x1 - self.x0 + 1) * (self.y1 - self.y0 + 1)

    def overlaps(self, other: Region) -> bool:
        """Whether a site lies in both rectangles."""
        return (
            self.site == other.site
            and max(self.x0, other.x0) <= min(self.x1, other.x1)
            and max(self.y0, other.y0) <= min(self.y1, other.y1)
        )


def read_regions(option: Option) -> tuple[Region, ...]:
    """Return the rectangles of a `Region_n` option; `FileError` names the line of a wrong one."""
    regions: list[Region] = []
    text = option.value
    position = 0
    while position < len(text):
        match = _RECTANGLE.match(text, position)
        if match is None:
            culprit = re.split(r"[\s,]", text[position:], maxsplit=1)[0]
            raise option.error(
                f"{option.name} holds {culprit!r}, which is no rectangle of sites of one type.",
                "Write `SITE_XaYb:SITE_XcYd`, for example `SLICE_X0Y150:SLICE_X103Y199`.",
                position,
            )
        x0, y0 = int(match["x0"]), int(match["y0"])
        x1, y1 = int(match["x1"] or x0), int(match["y1"] or y0)
        region = Region(match["site"], x0, y0, x1, y1, option.line_at(position))
        if region.x1 < region.x0 or region.y1 < region.y0:
            raise option.error(
                f"The corners of {region} are swapped.", "Write the lower left corner first.", position
            )
        twin = next((earlier for earlier in regions if region.overlaps(earlier)), None)
        if twin is not None:
            raise option.error(
                f"{region} overlaps {twin} of the same slot.", "Give each site of a slot once.", position
            )
        regions.append(region)
        position = match.end()
    return tuple(regions)
