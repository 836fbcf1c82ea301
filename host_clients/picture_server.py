"""The newest picture in the browser: a page on the loopback interface."""

from __future__ import annotations

import threading
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Self

import cv2

from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_PAGE = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>body {{ background: #0f1318; color: #e6edf3; font: 16px system-ui, sans-serif; text-align: center; }}
img {{ width: min(90vw, 960px); }}</style></head>
<body><h1>{title}</h1><img src="/stream" alt="{title}, live"></body></html>
"""
_LOOK_S = 1.0


class PictureServer:
    """Serves what `show` was given last, as a page with a motion JPEG, at `url`, until closed.

    It listens on 127.0.0.1 only; port 0 takes a free one. The title is the heading of the page. Raises
    UsageError when the port is taken.
    """

    def __init__(self, port: int, title: str) -> None:
        self._changed = threading.Condition()
        self._jpeg = b""
        self._number = 0
        self._closed = False
        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", port), self._handler(title))
        except OSError as error:
            raise UsageError(
                f"port {port} cannot be used for the pictures ({error.strerror}). Give another one."
            ) from None
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self._server.server_port}/"

    def show(self, picture: NDArray[np.uint8]) -> None:
        """Send a picture (uint8, blue, green, red) to whoever looks; callable from any thread."""
        _, jpeg = cv2.imencode(".jpg", picture)
        with self._changed:
            self._jpeg = jpeg.tobytes()
            self._number += 1
            self._changed.notify_all()

    def next_jpeg(self, seen: int) -> tuple[int, bytes] | None:
        """Return number and bytes of a picture after number `seen` once there is one, None when closed."""
        with self._changed:
            while not self._closed and self._number <= seen:
                self._changed.wait(_LOOK_S)
            return None if self._closed else (self._number, self._jpeg)

    def _handler(self, title: str) -> type[BaseHTTPRequestHandler]:
        page = _PAGE.format(title=title).encode()

        class Handler(BaseHTTPRequestHandler):
            pictures = self

            def handle(self) -> None:
                """Answer until the browser has gone."""
                with suppress(ConnectionError):
                    super().handle()

            def do_GET(self) -> None:
                """Answer with the page or the stream."""
                if self.path == "/":
                    self._begin("text/html; charset=utf-8")
                    self.wfile.write(page)
                elif self.path == "/stream":
                    self._begin("multipart/x-mixed-replace; boundary=picture")
                    self._stream()
                else:
                    self.send_error(HTTPStatus.NOT_FOUND)

            def log_message(self, *_: object) -> None:
                """Say nothing: the terminal belongs to the command."""

            def _begin(self, content_type: str) -> None:
                self.send_response(HTTPStatus.OK)
                self.send_header("Content-Type", content_type)
                self.send_header("Cache-Control", "no-store")
                self.end_headers()

            def _stream(self) -> None:
                seen = 0
                while (found := self.pictures.next_jpeg(seen)) is not None:
                    seen, jpeg = found
                    self.wfile.write(b"--picture\r\nContent-Type: image/jpeg\r\n")
                    self.wfile.write(b"Content-Length: %d\r\n\r\n%b\r\n" % (len(jpeg), jpeg))

        return Handler
