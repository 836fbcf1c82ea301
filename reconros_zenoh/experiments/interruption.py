"""Experiments that a signal ends early, and their processes, which leave that to them."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(slots=True)
class Interruption:
    """Whether Ctrl-C or SIGTERM has ended a block."""

    happened: bool = False


@contextmanager
def until_interrupted() -> Iterator[Interruption]:
    """Run the block to its end or to Ctrl-C or SIGTERM, so that what was measured is kept."""
    interruption = Interruption()
    try:
        yield interruption
    except (KeyboardInterrupt, SystemExit):  # the latter is SIGTERM while a deployment runs (`LocalRunner`)
        interruption.happened = True


@contextmanager
def sigint_blocked() -> Iterator[None]:
    """Start processes in the block: they never hear Ctrl-C, not even before their first line of Python.

    A terminal sends it to all of them, and this one, which hears it after the block, ends them.
    """
    resource_tracker.ensure_running()  # the first process would start it, which unblocks SIGINT
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
