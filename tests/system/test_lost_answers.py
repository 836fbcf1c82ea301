"""A client against a server that loses, falsifies and delays answers."""

from __future__ import annotations

from itertools import count
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np
from processes import LIMIT_S, Process

from host_clients.suite import exchange
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport

if TYPE_CHECKING:
    from pathlib import Path

    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.type_registry import TypeRegistry

SEED = 3
SWALLOWED, WRONG, LATE = 1, 3, 5
NEVER_RIGHT = 0xFFFF_FFFF


class Server:
    """Serves /angle as a board does, but for three requests of its client; it runs on Zenoh's threads."""

    def __init__(self, transport: ZenohTransport, types: TypeRegistry) -> None:
        inverse: Any = exchange("inverse", SEED)
        # A request is known by its content; the client's inputs begin with those of its first requests.
        self._angles: list[int] = [inverse.request(types, given).data for given in inverse._inputs]
        self.answers: list[int] = [inverse.expected(index) for index in range(len(self._angles))]
        self._late: list[int] = []
        number = types.message("std_msgs/msg/UInt32")
        self._answer_type = number.cls
        node = Context(transport).node("server")
        self._publisher = node.publisher(number, "/legangle")
        node.subscription(number, "/angle", self._on_request)

    def _on_request(self, received: Received) -> None:
        index = self._angles.index(received.message.data)
        if index == SWALLOWED:
            return
        if index == LATE:
            self._late.append(self.answers[index])
            return
        while self._late:
            self._answer(self._late.pop())
        self._answer(NEVER_RIGHT if index == WRONG else self.answers[index])

    def _answer(self, word: int) -> None:
        self._publisher.publish(self._answer_type(data=word))


def test_lost_wrong_and_late_answers_are_recorded_as_what_they_are(
    endpoint: str, types: TypeRegistry, tmp_path: Path
) -> None:
    record = tmp_path / "inverse.csv"
    with ZenohRouter.open(endpoint), ZenohTransport.open(endpoint) as transport:
        server = Server(transport, types)
        assert server.answers[LATE] != server.answers[LATE + 1]
        with Process(
            *("client", "inverse", "--requests=8", "--limit=1", "--seed", SEED),
            *("--router", endpoint, "--out", record),
        ) as client:
            assert client.end() == 1
    lines = [line.split(",") for line in record.read_text(encoding="ascii").splitlines()[1:]]
    assert [outcome for _, _, outcome in lines] == ["ok", "lost", "ok", "wrong", "ok", "lost", "ok", "ok"]
    assert [index for index, milliseconds, _ in lines if not milliseconds] == [str(SWALLOWED), str(LATE)]
    assert [line.split(", median")[0] for line in client.out] == ["inverse: 6 answers, 2 lost, 1 wrong"]
    assert client.err == []


def test_the_requests_to_a_server_that_has_gone_are_lost(
    endpoint: str, types: TypeRegistry, tmp_path: Path
) -> None:
    record = tmp_path / "sort.csv"
    waiting = Event()
    answered = count()

    def sort(received: Received) -> None:
        # The first request is the one that the client does not record.
        if next(answered) > 3:
            waiting.set()
            return
        assert received.responder is not None
        numbers = np.sort(received.message.unsorted)
        received.responder.respond_encoded(service.response.encode(service.response.cls(sorted=numbers)))

    service = types.service("sorter_msgs/srv/Sort")
    with ZenohRouter.open(endpoint):
        with ZenohTransport.open(endpoint) as transport:
            Context(transport).node("server").service(service, "/sorter", sort)
            client = Process(
                *("client", "sort", "--requests=6", "--limit=0.5"),
                *("--router", endpoint, "--out", record),
            )
            assert waiting.wait(LIMIT_S), client
        with client:
            assert client.end() == 1
    lines = record.read_text(encoding="ascii").splitlines()[1:]
    assert [line.split(",")[2] for line in lines] == ["ok", "ok", "ok", "lost", "lost", "lost"]
    assert client.err == []
