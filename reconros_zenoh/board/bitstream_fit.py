"""How large the partial bitstream of a region is that nobody has built: from its configuration frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

# Configuration frames of a column of the 7 series that is one clock region high, over the resources in it:
# 50 CLBs are 400 LUTs, and 20 DSP slices or 10 RAMB36 stand beside them (UG909, Configuration Frames). A
# column of block RAM has frames for its interconnect and more for its content (part databases of Project
# X-Ray).
_FRAMES_PER_LUT = 36 / 400
_FRAMES_PER_DSP = 28 / 20
_FRAMES_PER_BRAM36 = (28 + 128) / 10


def frames(lut: int, dsp: int, bram36: int) -> float:
    """Return how many configuration frames of the 7 series these resources have."""
    return lut * _FRAMES_PER_LUT + dsp * _FRAMES_PER_DSP + bram36 * _FRAMES_PER_BRAM36


@dataclass(frozen=True, slots=True)
class BitstreamFit:
    """`size = constant + bytes_per_frame * frames`: the least squares over known slots, never negative.

    Deviation: one figure per slot instead of a weight for each kind of resource, because the paper's three
    different slots would determine three weights exactly, and then nothing would say how wrong they are.
    Below two different slots, and where the constant would be negative, the size is proportional.
    """

    constant: float
    bytes_per_frame: float

    @classmethod
    def of(cls, known: Sequence[tuple[float, int]]) -> BitstreamFit:
        """Return the fit of (frames, size [bytes]) of at least one slot."""
        counts, sizes = np.array(known, dtype=np.float64).T
        centred = counts - counts.mean()
        spread = centred @ centred
        if spread > 0:
            slope = centred @ sizes / spread
            constant = sizes.mean() - slope * counts.mean()
            if slope >= 0 and constant >= 0:
                return cls(float(constant), float(slope))
        return cls(0.0, float(counts @ sizes / (counts @ counts)))

    def size(self, frames: float) -> int:
        """Return the estimated size [bytes]."""
        return round(self.constant + self.bytes_per_frame * frames)


def left_out_errors(known: Sequence[tuple[float, int]]) -> list[float]:
    """Return for each of at least two slots the relative error of its size, estimated from the others."""
    return [
        BitstreamFit.of([*known[:index], *known[index + 1 :]]).size(count) / size - 1
        for index, (count, size) in enumerate(known)
    ]
