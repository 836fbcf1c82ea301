"""Locks on what two processes, or two boards of one process, could write at the same time."""

from __future__ import annotations

import fcntl


def lock(descriptor: int) -> bool:
    """Hold a lock on the open file or folder until it is closed; False if somebody else holds one.

    True, without a lock, on network file systems that have none.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True
