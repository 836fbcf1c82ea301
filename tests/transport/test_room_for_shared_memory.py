"""Where no shared memory is left, sessions do without; what else keeps them from opening is told."""

from __future__ import annotations

from os import statvfs_result
from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.errors import TransportError
from reconros_zenoh.transport import zenoh, zenoh_session
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from pathlib import Path

PAGE = 4096


@pytest.mark.parametrize(("pages", "has"), [(0, False), (255, False), (256, True)])
def test_shared_memory_is_used_where_a_mebibyte_is_left(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, pages: int, has: bool
) -> None:
    left = statvfs_result((PAGE, PAGE, 1000, pages, pages, 0, 0, 0, 0, 255))
    monkeypatch.setattr(zenoh_session, "_SHARED_MEMORY", tmp_path)
    monkeypatch.setattr(zenoh_session.os, "statvfs", lambda _: left)
    monkeypatch.setattr(zenoh_session, "can_lock", lambda _: True)
    assert zenoh_session.has_shared_memory.__wrapped__() is has


def test_what_keeps_a_session_from_opening_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise zenoh_session.zenoh.ZError("Unable to create POSIX shm segment: OS error 12 at /a/b.rs:85.")

    monkeypatch.setattr(zenoh, "open_session", fail)
    with pytest.raises(TransportError) as caught:
        ZenohTransport.open("tcp/127.0.0.1:7447")
    assert str(caught.value) == (
        "no Zenoh session can be opened: Unable to create POSIX shm segment: OS error 12. "
        "See what this host lacks: `ulimit -a`, `df /dev/shm`."
    )
