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


@contextmanager
def terminal_signals_blocked() -> Iterator[None]:
    """Start processes in the block: they never hear Ctrl-C, not even before their first line of Python.

    Nor do they hear SIGHUP. A terminal sends both to all processes; this one, which hears them after the
    block, ends the others.
    """
    resource_tracker.ensure_running()  # the first process would start it, which unblocks SIGINT
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT, signal.SIGHUP])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
