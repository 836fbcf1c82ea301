"""How a process of this project begins: what it does about time, memory and signals."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import sys
from contextlib import contextmanager, suppress
from functools import cache
from typing import TYPE_CHECKING

from reconros_zenoh.clock.signals import ending_signals
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment

if TYPE_CHECKING:
    from collections.abc import Iterator

    import simpy

# <malloc.h> of glibc
_M_TRIM_THRESHOLD = -1
_M_TOP_PAD = -2
_M_MMAP_THRESHOLD = -3

# <sys/prctl.h> of Linux
_PR_SET_TIMERSLACK = 29

_MIB = 1024 * 1024
_OBJECTS_BETWEEN_COLLECTIONS = 50_000


def begin_process() -> tuple[WallEnvironment, simpy.Event]:
    """Tune this process and return its event loop, with the event that ends it.

    The signals that end a process make the event happen from now on, instead of anything else. For processes
    that run until they are told to end; called by the main thread.
    """
    tune_process()
    environment = WallEnvironment()
    ending = environment.event()
    for number in ending_signals():
        signal.signal(number, lambda *_: environment.post(succeed_once, ending))
    return environment, ending


def tune_process() -> None:
    """Make this process punctual and tune its memory; called when all is imported and no thread runs.

    Linux delays timers by up to 50 us to save wake-ups, and CPython hands the interpreter over every 5 ms
    only. OpenCV would keep other cores spinning for what is done sooner on one: a digit in 0.46 ms, not 0.49.
    """
    os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")  # read when it first computes
    sys.setswitchinterval(0.00005)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    tune_memory()


@contextmanager
def real_time_priority() -> Iterator[None]:
    """Let this thread go before all others of this host meanwhile, if that is allowed; not those it starts.

    Linux allows it to root and to users with a limit of real-time priorities above 0 (`ulimit -r`).
    """
    if sys.platform != "linux":
        yield
        return
    before, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    try:
        yield
    finally:  # only root can take the flag away
        with suppress(OSError):
            os.sched_setscheduler(0, before | os.SCHED_RESET_ON_FORK, parameters)


@cache
def tune_memory() -> None:
    """Leave what was imported out of the search for garbage, and keep large buffers in this process.

    To be called when everything is imported; only the first call does something, for what is garbage by a
    later one would stay for ever. CPython's collector would go through all modules time and again.
    """
    gc.freeze()
    gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS)
    _tune_malloc()


def _tune_malloc() -> None:
    """Freed buffers of up to 32 MiB stay in this process, so that the next large message finds them mapped.

    glibc otherwise returns every buffer of a large message to the kernel, and each new one costs a page
    fault per 4 KiB. Without effect on a C library that has no `mallopt`. The padding is address space, not
    memory: an idle process grows by nothing, a busy one keeps its largest use.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # not glibc; CDLL(None) is a TypeError on Windows
        return
    mallopt(_M_MMAP_THRESHOLD, 32 * _MIB)
    mallopt(_M_TRIM_THRESHOLD, 1024 * _MIB)
    mallopt(_M_TOP_PAD, 64 * _MIB)
