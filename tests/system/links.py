"""Ways to reach a Zenoh router that are not the usual one."""

from __future__ import annotations

import socket
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_LIMIT_S = 30
_BYTES_PER_S = 12_500_000
_BUFFER_BYTES = 65_536  # larger ones take a whole message meanwhile


def as_another_host_does(router: str) -> str:
    """Return the router's endpoint, which is on the loopback, so that it does not look like that."""
    return router.replace("127.0.0.1", "0.0.0.0")


@contextmanager
def slow_link(router: str) -> Iterator[str]:
    """Give an endpoint from which one session reaches the router, at 100 Mbit/s in each direction."""

    def pass_on(source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while part := source.recv(_BUFFER_BYTES):
                Event().wait(len(part) / _BYTES_PER_S)
                sink.sendall(part)

    def serve() -> None:
        near, _ = server.accept()
        host, port = router.removeprefix("tcp/").split(":")
        with near, socket.socket() as far:
            far.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
            far.connect((host, int(port)))
            back = Thread(target=pass_on, args=(far, near), daemon=True)
            back.start()
            pass_on(near, far)
            far.shutdown(socket.SHUT_RDWR)
            back.join(_LIMIT_S)

    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        thread = Thread(target=serve, daemon=True)
        thread.start()
        yield as_another_host_does(f"tcp/127.0.0.1:{server.getsockname()[1]}")
        thread.join(_LIMIT_S)
