"""Where the processes of an experiment can listen on this host."""

from __future__ import annotations

import socket


def free_port() -> int:
    """Return a port of the loopback interface that was free just now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def free_endpoint() -> str:
    """Return a Zenoh endpoint at such a port."""
    return f"tcp/127.0.0.1:{free_port()}"
