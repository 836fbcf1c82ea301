"""The 33 bytes beside every message."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from zenoh.ext import Int64, z_serialize

from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.ros.attachment import Attachment

int64 = st.integers(-(2**63), 2**63 - 1)
gids = st.binary(min_size=16, max_size=16)
GID = bytes.fromhex("7c09e8f22895b58a7d36790c0281fe0c")


def test_golden_bytes() -> None:
    data = Attachment(1, 0x0102030405060708, GID).encode()
    assert data.hex() == "0100000000000000" + "0807060504030201" + "10" + GID.hex()


@given(int64, int64, gids)
def test_round_trip_in_the_bytes_that_zenoh_gives(sequence: int, timestamp: int, gid: bytes) -> None:
    attachment = Attachment(sequence, timestamp, gid)
    data = attachment.encode()
    assert len(data) == 33
    assert data == z_serialize((Int64(sequence), Int64(timestamp), gid)).to_bytes()
    assert Attachment.decode(data) == attachment


@pytest.mark.parametrize(
    ("data", "detail"),
    [
        (None, "has no attachment"),
        (b"", "0 bytes instead of 33"),
        (bytes(32), "32 bytes instead of 33"),
        (bytes(34), "34 bytes instead of 33"),
        (bytes(33), "a gid of 0 bytes"),
    ],
)
def test_what_is_no_attachment(data: bytes | None, detail: str) -> None:
    with pytest.raises(BadMessageError, match=detail) as caught:
        Attachment.decode(data)
    assert caught.value.reason == "no_attachment"
