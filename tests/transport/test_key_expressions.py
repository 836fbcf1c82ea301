from __future__ import annotations

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.errors import TransportError
from reconros_zenoh.transport.key_expressions import check_key, intersects

CHUNKS = ["a", "b", "ab", "*", "**", "$*a", "a$*", "a$*b", "b$*a$*", "@a", "@ab", "%chatter"]
expressions = st.lists(st.sampled_from(CHUNKS), min_size=1, max_size=5).map(
    lambda chunks: str(zenoh.KeyExpr.autocanonize("/".join(chunks)))
)


@given(expressions, expressions)
def test_intersects_as_zenoh_does(left: str, right: str) -> None:
    assert intersects(left, right) == zenoh.KeyExpr(left).intersects(zenoh.KeyExpr(right))


@given(st.text("ab*$/@?#", max_size=8))
def test_accepts_what_zenoh_accepts(text: str) -> None:
    try:
        check_key(text)
    except TransportError:
        with pytest.raises(zenoh.ZError):
            zenoh.KeyExpr(text)
    else:
        zenoh.KeyExpr.autocanonize(text)


@pytest.mark.parametrize(
    ("left", "right", "expected"),
    [
        ("0/chatter/t/h", "0/chatter/t/h", True),
        ("0/chatter/t/h", "1/chatter/t/h", False),
        ("@ros2_lv/0/**", "@ros2_lv/0/59/1/1/NN/%/%/node", True),
        ("**", "@ros2_lv/0/59/1/1/NN/%/%/node", False),
        ("@ros2_lv/0/*", "@ros2_lv/0", False),
        ("@ros2_lv/0/**", "@ros2_lv/0", True),
        ("reconros/*/status", "reconros/board_1/**", True),
        ("reconros/board$*/status", "reconros/board_1/status", True),
        ("reconros/board$*/status", "reconros/my_board/status", False),
        ("$*lv/0", "@ros2_lv/0", False),
    ],
)
def test_intersects(left: str, right: str, expected: bool) -> None:
    assert intersects(left, right) is expected
    assert intersects(right, left) is expected
