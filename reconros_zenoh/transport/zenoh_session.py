"""How sessions of this project use Zenoh: their configuration, its threads, and shared memory."""

from __future__ import annotations

import ctypes
import json
import os
import re
import sys
import threading
from contextlib import suppress
from functools import cache
from ipaddress import ip_address
from pathlib import Path
from queue import SimpleQueue
from shutil import disk_usage
from typing import TYPE_CHECKING, TypeVar

import zenoh
from zenoh.handlers import Callback
from zenoh.shm import GarbageCollect, ShmProvider, ZShmMut

from reconros_zenoh.errors import UsageError
from reconros_zenoh.transport.memory import can_lock

if TYPE_CHECKING:
    from collections.abc import Callable

# One pool instead of a thread per stage nearly halves a round trip; of two threads, closing can have to wait.
# A socket is watched by the pool that accepted it: were `acc` elsewhere, a message would wake a thread more.
# Only what sends is apart: a callback that publishes a large message without shared memory waits for it, in
# the same pool in vain, and then the message is dropped.
_THREADS = "(rx: (handover: net), tx: (worker_threads: 1), acc: (handover: net), net: (worker_threads: 4))"
# A router passes messages on with the threads that receive: one that waits for a slow link would keep its own
# pool from seeing that the link has room again. So its pools are Zenoh's own.
_ROUTER_THREADS = "()"
_RUNTIME = "ZENOH_RUNTIME"

# From here on [byte] Zenoh hands messages over by shared memory. A round trip of 16 KiB took 0.20 ms with it
# and 0.18 without, 32 KiB 0.20 both, 64 KiB 0.23 and 0.28; Zenoh's own default is 3 KiB.
_SHARED_FROM = 32 * 1024

# What a process may have to map: its own pools, and those of several peers.
_LOCKED_BYTES = 1 << 30

# Where it is, and what must be left there: a session makes some segments of a few kB before its pools.
_SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 # only looked at
_ROOM_BYTES = 1 << 20

# How long [us] a message, and all fragments of a large one, wait for room on a link before they are dropped.
# In Zenoh's own 1 and 50 ms no image gets to a host behind 100 Mbit/s. What must not be dropped waits 5 s,
# Zenoh's default, and then the link is closed.
_WAIT_US = 50_000
_WAIT_LARGE_US = 5_000_000
_DROP = "transport/link/tx/queue/congestion_control/drop"

_ADDRESS = re.compile(r"\w+/(?P<host>.+):\d+([?#].*)?")

_COLLECT = GarbageCollect()

_T = TypeVar("_T")
_thread = threading.local()


def configuration(mode: str, endpoints: dict[str, str]) -> zenoh.Config:
    """Return the configuration of rmw_zenoh (gossip is on); raises UsageError when an endpoint is none."""
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    for entry, endpoint in endpoints.items():
        try:
            config.insert_json5(entry, json.dumps([endpoint]))
        except zenoh.ZError as error:
            raise UsageError(f"{endpoint!r} is not a Zenoh endpoint such as tcp/127.0.0.1:7447") from error
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")  # the caches of transient local publishers need it
    config.insert_json5("transport/shared_memory/enabled", json.dumps(has_shared_memory()))
    optimization = "transport/shared_memory/transport_optimization"
    config.insert_json5(f"{optimization}/message_size_threshold", json.dumps(_SHARED_FROM))
    config.insert_json5(f"{_DROP}/wait_before_drop", json.dumps(_WAIT_US))
    config.insert_json5(f"{_DROP}/max_wait_before_drop_fragments", json.dumps(_WAIT_LARGE_US))
    return config


def open_session(config: zenoh.Config) -> zenoh.Session:
    """Return a new session; raises ZError. The first one of a process makes the threads for all.

    They are those that suit boards and clients, unless the environment names others.
    """
    if _RUNTIME in os.environ:
        return zenoh.open(config)
    os.environ[_RUNTIME] = _THREADS
    try:
        return zenoh.open(config)
    finally:
        os.environ.pop(_RUNTIME, None)  # else the processes that this one starts would have them, too


def use_threads_of_a_router() -> None:
    """Make this process one that only routes; to be called before it opens its router."""
    os.environ.setdefault(_RUNTIME, _ROUTER_THREADS)


@cache
def has_shared_memory() -> bool:
    """Whether this process uses shared memory; peers that do send it everything through sockets otherwise.

    With shared memory switched on and none to be had, a session does not open. Zenoh locks every segment in
    memory, also those of its peers, and a message whose segment cannot be locked is lost without a word
    (Zenoh issue 2788). Linux lets ordinary users lock 8 MiB.
    """
    if sys.platform != "linux":
        return True
    is_usable = os.access(_SHARED_MEMORY, os.W_OK)
    return is_usable and disk_usage(_SHARED_MEMORY).free >= _ROOM_BYTES and can_lock(_LOCKED_BYTES)


def is_of_this_host(endpoint: str) -> bool:
    """Return whether `endpoint` is on the loopback; names other than localhost are taken for other hosts."""
    address = _ADDRESS.fullmatch(endpoint)
    if address is None:  # unixsock-stream/..., or no endpoint at all
        return True
    with suppress(ValueError):
        return ip_address(address["host"].strip("[]")).is_loopback
    return address["host"] == "localhost"


def direct(callback: Callable[[_T], None], drop: Callable[[], None] | None = None) -> Callback[_T]:
    """Return a handler that runs on Zenoh's threads.

    For a thread that it has not started, Python makes a thread state at every callback, maps memory for its
    frames, and unmaps that at the end, which interrupts the other cores: a twentieth of a small round trip.
    Asked for once more, the state stays as long as the thread.
    """

    def call(argument: _T) -> None:
        if not hasattr(_thread, "has_state"):
            _thread.has_state = True
            ctypes.pythonapi.PyGILState_Ensure()
        callback(argument)

    return Callback(call, drop, indirect=False)


def queued(callback: Callable[[_T], None]) -> Callback[_T]:
    """Return a handler that runs on a thread of its own and never keeps one of Zenoh's waiting.

    An indirect `Callback` would: from the 257th argument that waits for it on.
    """
    waiting: SimpleQueue[tuple[_T] | None] = SimpleQueue()

    def work() -> None:
        while (argument := waiting.get()) is not None:
            callback(*argument)
            del argument  # it may lie in shared memory of its sender

    threading.Thread(target=work, name="subscription", daemon=True).start()
    return direct(lambda argument: waiting.put((argument,)), lambda: waiting.put(None))


def open_pool(pool_bytes: int) -> Callable[[int], ZShmMut | None] | None:
    """Return what takes frames out of a new pool, as `Frames` wants it; None without shared memory."""
    if not has_shared_memory():
        return None
    try:
        pool = ShmProvider.default_backend(pool_bytes)
    except zenoh.ZError:
        return None

    def allocate(size: int) -> ZShmMut | None:
        # It does not wait (BlockOn): a reader that keeps its samples would stop the publisher.
        for _ in range(2):  # what the first try collects may suffice for the second only
            with suppress(zenoh.ZError):
                return pool.alloc(size, _COLLECT)
        return None

    return allocate
