"""`reconros router` between hosts."""

from __future__ import annotations

from queue import SimpleQueue
from threading import Event
from typing import TYPE_CHECKING

import numpy as np
import pytest
from links import as_another_host_does, slow_link
from processes import LIMIT_S, Process

from reconros_zenoh.ros.qos import QosProfile
from reconros_zenoh.transport import zenoh_session
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reconros_zenoh.transport.base import Sample


@pytest.fixture
def router(endpoint: str) -> Iterator[str]:
    with Process("router", "--listen", endpoint) as process:
        process.wait_for("listens")
        yield endpoint


def test_large_messages_are_passed_on_over_a_slow_link(router: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_session, "has_shared_memory", lambda: False)  # as between hosts
    message = np.random.default_rng(0).bytes(6_000_000)
    arrived: SimpleQueue[Sample] = SimpleQueue()
    matched = Event()
    with (
        slow_link(router) as far,
        ZenohTransport.open(far) as there,
        ZenohTransport.open(as_another_host_does(router)) as here,
    ):
        there.subscribe("key", arrived.put, QosProfile())
        publisher = here.publish("key", QosProfile(), lambda matching: matched.set() if matching else None)
        assert matched.wait(LIMIT_S)
        for _ in range(5):  # the first ones get through any router
            publisher.put([message], None)
            assert arrived.get(timeout=LIMIT_S).payload == message
