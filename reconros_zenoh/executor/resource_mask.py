"""Where a callback may run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

SOFTWARE = -1
"""The resource number of the processor cores; slots are numbered from 0."""


@dataclass(frozen=True, slots=True)
class ResourceMask:
    """A field for software and one for each slot that a hardware worker serves.

    A filled field holds the implementation that a worker of that resource starts: the function of the
    callback for software, the bitstream for a slot (ReconROS Executor, Section III-B).
    """

    implementations: dict[int, object]

    @classmethod
    def of(cls, *, software: object | None = None, slots: Mapping[int, object] | None = None) -> ResourceMask:
        """Return the mask with these fields filled; raise ValueError for a negative slot."""
        fields = dict(slots or {})
        if any(slot < 0 for slot in fields):
            raise ValueError("slots are numbered from 0")
        if software is not None:
            fields[SOFTWARE] = software
        return cls(fields)

    def __contains__(self, resource: int) -> bool:
        return resource in self.implementations
