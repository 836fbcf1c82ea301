"""Real-time priority for a process that keeps a clock, where its user may have it.

On a host whose cores are busy with other processes an event waits until the scheduler comes round to it, for
a millisecond and more. Root may ask to go before them, and whoever has a limit `rtprio` of 2 or more.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress

_CLOCK_PRIORITY = 2


def prefer_this_process() -> None:
    """Have the threads that this one starts from now on, and itself, run before those of other processes.

    Nothing changes where the user may not do that, nor for a process with a real-time priority already.
    Linux only.
    """
    if sys.platform == "linux" and os.sched_getscheduler(0) == os.SCHED_OTHER:
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_CLOCK_PRIORITY))


def yield_to_clock() -> None:
    """Have this thread of a preferred process run after those that keep the clock.

    Still before other processes: it may hold the interpreter, for which the clock would wait.
    """
    if sys.platform == "linux" and os.sched_getscheduler(0) == os.SCHED_FIFO:
        priority = os.sched_getparam(0).sched_priority
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(max(1, priority - 1)))
