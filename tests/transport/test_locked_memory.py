"""What becomes of large messages where a process may lock 8 MiB of memory, as ordinary users of Linux may."""

from __future__ import annotations

import subprocess
import sys

# A process keeps the right of root to lock as much as it likes until it executes the next program.
AS_ORDINARY_USER = """
import ctypes, os, resource, sys

PR_CAPBSET_DROP, CAP_IPC_LOCK = 24, 14
ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_IPC_LOCK)
_, hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
limit = 8 << 20 if hard == resource.RLIM_INFINITY else min(hard, 8 << 20)
resource.setrlimit(resource.RLIMIT_MEMLOCK, (limit, limit))
os.execv(sys.executable, [sys.executable, "-c", sys.argv[1]])
"""

TRY_TO_LOCK = """
from reconros_zenoh.transport.memory import can_lock

print(can_lock(4096), can_lock(1 << 30))
"""

# The reader keeps what it got, so that no shared memory becomes free.
SEND_AND_KEEP = """
import socket
from queue import SimpleQueue
from threading import Event

from reconros_zenoh.ros.qos import History, QosProfile
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport

with socket.create_server(("127.0.0.1", 0)) as server:
    endpoint = f"tcp/127.0.0.1:{server.getsockname()[1]}"
whole = QosProfile(history=History.KEEP_ALL)  # waits rather than loses
matched, arrived, kept = Event(), SimpleQueue(), []
router = ZenohRouter.open(endpoint)
with router, ZenohTransport.open(endpoint) as here, ZenohTransport.open(endpoint) as there:
    there.subscribe("key", arrived.put, whole)
    publisher = here.publish("key", whole, lambda matching: matched.set() if matching else None)
    assert matched.wait(30)
    for size in (2**20, 2**20, 6 * 2**20, 2**20, 3, 6 * 2**20):
        publisher.put([bytes(size)], None)
        kept.append(arrived.get(timeout=30))
        assert len(kept[-1].payload) == size
print(len(kept))
"""


def as_ordinary_user(program: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", AS_ORDINARY_USER, program],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


def test_the_limit_is_noticed() -> None:
    assert as_ordinary_user(TRY_TO_LOCK) == ["True", "False"]


def test_no_message_is_lost_for_want_of_memory_that_may_be_locked() -> None:
    assert as_ordinary_user(SEND_AND_KEEP) == ["6"]
