"""The page with the filtered pictures."""

from __future__ import annotations

import socket
from contextlib import closing
from http.client import HTTPConnection
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest

from host_clients.picture_server import PictureServer
from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from http.client import HTTPResponse

LIMIT_S = 30
GREY, WHITE = (np.full((48, 64, 3), level, np.uint8) for level in (128, 255))


@pytest.fixture
def server() -> Iterator[PictureServer]:
    with PictureServer(0, "what is seen") as server:
        yield server


def connect(server: PictureServer) -> HTTPConnection:
    return HTTPConnection(urlsplit(server.url).netloc, timeout=LIMIT_S)


def next_picture(response: HTTPResponse) -> float:
    """Return the mean of the next picture of a stream."""
    assert response.readline().rstrip() == b"--picture"
    assert response.readline().rstrip() == b"Content-Type: image/jpeg"
    length = int(response.readline().split(b":")[1])
    response.readline()
    picture = cv2.imdecode(np.frombuffer(response.read(length), np.uint8), cv2.IMREAD_COLOR)
    response.readline()
    return float(np.mean(picture))


def test_the_page_shows_the_stream_and_listens_on_loopback_only(server: PictureServer) -> None:
    assert server.url.startswith("http://127.0.0.1:")
    with closing(connect(server)) as connection:
        connection.request("GET", "/")
        page = connection.getresponse()
        assert page.status == 200
        assert b'src="/stream"' in page.read()


def test_the_stream_has_each_picture_that_is_shown(server: PictureServer) -> None:
    server.show(GREY)
    with closing(connect(server)) as connection:
        connection.request("GET", "/stream")
        stream = connection.getresponse()
        assert next_picture(stream) == pytest.approx(128, abs=2)
        server.show(WHITE)
        assert next_picture(stream) == pytest.approx(255, abs=2)


def test_the_stream_ends_with_the_server_and_a_browser_that_goes_does_no_harm() -> None:
    with PictureServer(0, "what is seen") as server:
        stays, goes = connect(server), connect(server)
        server.show(GREY)
        streams = []
        for connection in (stays, goes):
            connection.request("GET", "/stream")
            streams.append(connection.getresponse())
        assert next_picture(streams[1]) == pytest.approx(128, abs=2)
        goes.close()
        assert next_picture(streams[0]) == pytest.approx(128, abs=2)
        server.show(WHITE)
        assert next_picture(streams[0]) == pytest.approx(255, abs=2)
    with closing(stays):
        assert streams[0].read() == b""


def test_a_browser_that_is_gone_before_its_answer_is_no_error(server: PictureServer) -> None:
    ours, gone = socket.socketpair()
    gone.sendall(b"GET / HTTP/1.0\r\n\r\n")
    gone.close()
    with ours:
        server._server.finish_request(ours, ("127.0.0.1", 0))


def test_another_path_is_not_found(server: PictureServer) -> None:
    with closing(connect(server)) as connection:
        connection.request("GET", "/../etc/passwd")
        assert connection.getresponse().status == 404


def test_a_port_that_is_taken_is_named(server: PictureServer) -> None:
    port = urlsplit(server.url).port
    assert port is not None
    with pytest.raises(UsageError, match=f"port {port} cannot be used for the pictures"):
        PictureServer(port, "what is seen")
