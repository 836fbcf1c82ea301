"""What other peers of a Zenoh network may answer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import zenoh

from reconros_zenoh.transport.zenoh import _Querier

if TYPE_CHECKING:
    from reconros_zenoh.transport.base import Reply


def test_an_error_that_is_no_text_is_an_answer() -> None:
    replies: list[Reply | None] = []
    querier: Any = SimpleNamespace(call=lambda on_reply, reply: on_reply(reply))
    error: Any = SimpleNamespace(
        ok=None, err=SimpleNamespace(payload=zenoh.ZBytes(b"no \xff")), replier_id=None
    )
    _Querier._take(querier, replies.append, error)
    (reply,) = replies
    assert reply is not None
    assert (reply.payload, reply.error) == (None, "no \ufffd")
