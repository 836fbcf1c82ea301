"""What keeps messages from going round: filters on publisher ids, and one gateway per topic.

Source: Gateways, Section 3: "our gateway core implementation includes message filters in both its subscribers
on the SMT and HMT sides. These filters check and discard messages for their publisher IDs".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable


@dataclass(frozen=True, slots=True)
class PublisherFilter:
    """Lets everything pass but what its own publisher has published."""

    own: Hashable

    def passes(self, publisher: Hashable) -> bool:
        """Tell whether a message of this publisher is somebody else's."""
        return publisher != self.own


@dataclass(frozen=True, slots=True)
class Pair:
    """The two topics that a gateway keeps alike; names as their key spaces have them."""

    hmt: str
    smt: str


def conflict(pair: Pair, others: Iterable[Pair]) -> str | None:
    """Return which topic of the pair has a gateway among `others` of the same board already, or None.

    With one gateway per topic no message can go round: each HMT is a leaf at one SMT, whatever number of
    boards shares it. Two gateways on one pair would forward each other's messages for ever, as neither
    filter knows the other's publisher.
    """
    for other in others:
        if other.hmt == pair.hmt:
            return pair.hmt
        if other.smt == pair.smt:
            return pair.smt
    return None
