"""Becomes the given command, tied to the life of the process that started it.

Run as a script, in an interpreter of its own: `python -I -S launch.py PARENT_PID COMMAND [ARGUMENT ...]`.

On Linux the kernel is asked to kill this process when its parent dies (PR_SET_PDEATHSIG, prctl(2)), which
also works when the parent had no chance to clean up. The setting survives exec, so it is made here and not
between fork and exec (`preexec_fn`), where a parent with several threads may deadlock. It reaches this
process only: processes that the command starts in turn must end when they lose their parent.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1  # <linux/prctl.h>


def main(parent: int, command: list[str]) -> None:
    """Replace this process by the command; end with status 127 when it cannot be started."""
    if sys.platform == "linux":
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) != 0:
            sys.exit(f"prctl failed: {os.strerror(ctypes.get_errno())}")
    if os.getppid() != parent:  # it died before the kernel was asked
        sys.exit("the process that started this one is gone")
    try:
        os.execvp(command[0], command)  # noqa: S606  # there is no shell to protect from
    except OSError as error:
        print(f"{command[0]} cannot be started: {error.strerror}", file=sys.stderr)
        sys.exit(127)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
