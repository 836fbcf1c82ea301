"""Experiments that a signal ends early."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(slots=True)
class Interruption:
    """Whether a signal that asks to end has ended a block."""

    happened: bool = False


@contextmanager
def until_interrupted() -> Iterator[Interruption]:
    """Run the block to its end or to a signal that asks to end, so that what was measured is kept."""
    interruption = Interruption()
    try:
        yield interruption
    except (KeyboardInterrupt, SystemExit):  # the latter is no Ctrl-C while a deployment runs (`LocalRunner`)
        interruption.happened = True
