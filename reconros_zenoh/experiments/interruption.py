"""Experiments that a signal ends early."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from reconros_zenoh.clock.signals import EndingHandler

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(slots=True)
class Interruption:
    """Whether a signal that asks to end has ended a block."""

    happened: bool = False


@contextmanager
def until_interrupted() -> Iterator[Interruption]:
    """Run the block to its end or to a signal that asks to end, so that what was measured is kept.

    What a command does after the block is to write and show that: a first signal then waits for the end of
    the process, or for the next such block, which raises KeyboardInterrupt instead of beginning.
    """
    interruption = Interruption()
    handler = signal.getsignal(signal.SIGINT)
    ending = handler if isinstance(handler, EndingHandler) else None  # a notebook's are held back by nobody
    if ending is not None:
        ending.release()
    try:
        yield interruption
    except (KeyboardInterrupt, SystemExit):  # the latter is no Ctrl-C while a deployment runs (`LocalRunner`)
        interruption.happened = True
    finally:
        if ending is not None:
            ending.hold()
