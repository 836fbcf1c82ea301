"""A board that gets messages it cannot use counts them, names the sender once, and goes on."""

from __future__ import annotations

import itertools
import time
from queue import SimpleQueue
from threading import Event
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from processes import LIMIT_S

from host_clients.suite import EXCHANGES, exchange
from reconros_zenoh.board.control import ask_status
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.attachment import Attachment
from reconros_zenoh.ros.image import image_message
from reconros_zenoh.ros.names import data_key
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Network

    from reconros_zenoh.ros.type_registry import TypeRegistry
    from reconros_zenoh.transport.base import Reply

LIMIT_NS = LIMIT_S * 10**9
UINT32 = "std_msgs/msg/UInt32"
IMAGE = "sensor_msgs/msg/Image"
SORT = "sorter_msgs/srv/Sort"
NUMBER = b"\x00\x01\x00\x00\x08\x00\x00\x00"

_senders = itertools.count(1)


class Matched(Event):
    """Set once the board is known."""

    def note(self, matching: bool) -> None:
        if matching:
            self.set()


def new_sender() -> bytes:
    """Return the gid of a publisher that has sent nothing yet."""
    return next(_senders).to_bytes(2, "big") * 8


def attachment(sender: bytes) -> bytes:
    return Attachment(1, time.time_ns(), sender).encode()


def topic_key(types: TypeRegistry, topic: str, type_name: str) -> str:
    message_type = types.message(type_name)
    return data_key(0, topic, message_type.dds_name, message_type.type_hash)


def publish(network: Network, key: str, payload: bytes, with_attachment: bytes | None, times: int) -> None:
    """Publish the same bytes some times, once the board listens."""
    matched = Matched()
    publisher = network.transport.publish(key, QosProfile(), matched.note)
    assert matched.wait(LIMIT_S)
    for _ in range(times):
        publisher.put([payload], with_attachment)
    publisher.close()


class Refusals:
    """What the board has refused since this was made."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._before = self._counts()

    def wait_for(self, **expected: int) -> None:
        """Return when exactly these messages, by reason, have been refused."""
        end = time.monotonic() + LIMIT_S
        while (counts := self._since()) != expected and time.monotonic() < end:
            pass
        assert counts == expected

    def _since(self) -> dict[str, int]:
        new = {reason: n - self._before.get(reason, 0) for reason, n in self._counts().items()}
        return {reason: n for reason, n in new.items() if n}

    def _counts(self) -> dict[str, int]:
        return dict(ask_status(self._network.transport, "board0")["rejected"])


def assert_logged_once(network: Network, types: TypeRegistry, reason: str, sender: str) -> None:
    """Fail unless the board has written one line with this sender and this reason."""
    # What it wrote before the line of a later sender has been read when that one is there.
    last = new_sender()
    publish(network, topic_key(types, "/angle", UINT32), NUMBER[:5], attachment(last), times=1)
    network.board.wait_for(last.hex())
    assert network.board.count(sender, f"({reason}: ") == 1, network.board


def picture(types: TypeRegistry, encoding: str, *shape: int) -> bytes:
    message = image_message(types, encoding, np.zeros(shape, np.uint8))
    return b"".join(types.message(IMAGE).encode(message))


class Bad(NamedTuple):
    """A topic, a payload that its subscriber cannot use, and why."""

    topic: str
    type_name: str
    payload: Callable[[TypeRegistry], bytes]
    reason: str


BAD = {
    "no payload": Bad("/angle", UINT32, lambda _: b"", "truncated"),
    "a number cut short": Bad("/angle", UINT32, lambda _: NUMBER[:6], "truncated"),
    "a picture cut short": Bad(
        "/image_raw", IMAGE, lambda types: picture(types, "bgr8", 480, 640, 3)[:-1000], "truncated"
    ),
    "a number in big endian": Bad("/angle", UINT32, lambda _: b"\x00\x00" + NUMBER[2:], "foreign_encoding"),
    "a number in PL_CDR": Bad("/angle", UINT32, lambda _: b"\x00\x03" + NUMBER[2:], "foreign_encoding"),
    "leg 7": Bad("/angle", UINT32, lambda _: NUMBER[:4] + b"\x07\x00\x00\x00", "leg"),
    "a picture of another size": Bad(
        "/image_raw", IMAGE, lambda types: picture(types, "bgr8", 240, 320, 3), "image_size"
    ),
    "a digit of another size": Bad(
        "/image_classification", IMAGE, lambda types: picture(types, "mono8", 32, 32), "image_size"
    ),
    "a picture of another encoding": Bad(
        "/image_raw", IMAGE, lambda types: picture(types, "rgb8", 480, 640, 3), "image_encoding"
    ),
    "a digit in colour": Bad(
        "/image_classification", IMAGE, lambda types: picture(types, "bgr8", 28, 28, 3), "image_encoding"
    ),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_a_bad_message_is_counted_each_time_and_its_sender_named_once(
    network: Network, types: TypeRegistry, bad: Bad
) -> None:
    refusals = Refusals(network)
    key = topic_key(types, bad.topic, bad.type_name)
    payload = bad.payload(types)
    first, second = new_sender(), new_sender()
    publish(network, key, payload, attachment(first), times=2)
    publish(network, key, payload, attachment(second), times=1)
    refusals.wait_for(**{bad.reason: 3})
    assert_logged_once(network, types, bad.reason, first.hex())
    assert_logged_once(network, types, bad.reason, second.hex())


@pytest.mark.parametrize("given", [None, b"", b"\x00" * 24], ids=["none", "empty", "of an older release"])
def test_a_message_without_a_usable_attachment_is_counted_under_its_key(
    network: Network, types: TypeRegistry, given: bytes | None
) -> None:
    refusals = Refusals(network)
    key = topic_key(types, "/angle", UINT32)
    publish(network, key, NUMBER, given, times=2)
    refusals.wait_for(no_attachment=2)
    assert_logged_once(network, types, "no_attachment", f" {key} from an unknown sender")


@pytest.mark.parametrize(
    ("place", "other", "reason"), [(0, "1", "foreign_domain"), (-1, "RIHS01_0", "type_mismatch")]
)
def test_a_message_of_another_domain_or_type_is_noticed(
    network: Network, types: TypeRegistry, place: int, other: str, reason: str
) -> None:
    refusals = Refusals(network)
    chunks = topic_key(types, "/angle", UINT32).split("/")
    chunks[place] = other
    key = "/".join(chunks)
    publish(network, key, NUMBER, attachment(new_sender()), times=2)
    refusals.wait_for(**{reason: 2})
    assert_logged_once(network, types, reason, f" {key} from an unknown sender")


def numbers(types: TypeRegistry, count: int) -> bytes:
    request_type = types.service(SORT).request
    return b"".join(request_type.encode(request_type.cls(unsorted=np.zeros(count, np.uint32))))


def ask(network: Network, types: TypeRegistry, payload: bytes, with_attachment: bytes | None) -> Reply | None:
    """Return the first reply of the sorter."""
    service = types.service(SORT)
    matched = Matched()
    replies: SimpleQueue[Reply | None] = SimpleQueue()
    querier = network.transport.request(
        data_key(0, "/sorter", service.dds_name, service.type_hash),
        matched.note,
    )
    assert matched.wait(LIMIT_S)
    querier.get([payload], with_attachment, replies.put, LIMIT_NS)
    reply = replies.get(timeout=LIMIT_S)
    querier.close()
    return reply


@pytest.mark.parametrize(
    ("place", "other", "reason"), [(0, "1", "foreign_domain"), (-1, "RIHS01_0", "type_mismatch")]
)
def test_a_request_of_another_domain_or_type_is_answered_with_the_reason(
    network: Network, types: TypeRegistry, place: int, other: str, reason: str
) -> None:
    refusals = Refusals(network)
    service = types.service(SORT)
    chunks = data_key(0, "/sorter", service.dds_name, service.type_hash).split("/")
    chunks[place] = other
    key = "/".join(chunks)
    for _ in range(2):
        (reply,) = network.transport.session.get(
            key, payload=numbers(types, 2048), attachment=attachment(new_sender()), timeout=LIMIT_S
        )
        assert reply.err is not None
        assert reply.err.payload.to_string().startswith(f"{reason}: ")
    refusals.wait_for(**{reason: 2})
    assert_logged_once(network, types, reason, f" {key} from an unknown sender")


REQUESTS: dict[str, tuple[Callable[[TypeRegistry], bytes], str, str]] = {
    "one number too few": (lambda types: numbers(types, 2047), "number_count", "2047 numbers"),
    "a million numbers": (lambda types: numbers(types, 10**6), "number_count", "1000000 numbers"),
    "cut short": (lambda types: numbers(types, 2048)[:-1], "truncated", "8199 bytes"),
    "CDR2": (lambda types: b"\x00\x07" + numbers(types, 2048)[2:], "foreign_encoding", "CDR2 little endian"),
}


@pytest.mark.parametrize(("payload", "reason", "detail"), REQUESTS.values(), ids=REQUESTS)
def test_a_bad_request_is_answered_with_the_reason(
    network: Network,
    types: TypeRegistry,
    payload: Callable[[TypeRegistry], bytes],
    reason: str,
    detail: str,
) -> None:
    refusals = Refusals(network)
    sender = new_sender()
    for _ in range(2):
        reply = ask(network, types, payload(types), attachment(sender))
        assert reply is not None
        assert reply.payload is None
        assert reply.error is not None
        assert reply.error.startswith(f"{reason}: ")
        assert detail in reply.error
    refusals.wait_for(**{reason: 2})
    assert_logged_once(network, types, reason, sender.hex())


def test_a_request_without_attachment_is_answered_with_the_reason(
    network: Network, types: TypeRegistry
) -> None:
    refusals = Refusals(network)
    reply = ask(network, types, numbers(types, 2048), None)
    assert reply is not None
    assert reply.error == "no_attachment: the message has no attachment"
    refusals.wait_for(no_attachment=1)


@pytest.mark.parametrize("kind", EXCHANGES)
def test_after_all_that_the_board_answers_good_requests(
    network: Network, types: TypeRegistry, kind: str
) -> None:
    refusals = Refusals(network)
    answers: SimpleQueue[Any] = SimpleQueue()
    matched = Matched()
    node = Context(network.transport).node(f"{kind}_test")
    asked = exchange(kind, seed=1)
    asked.open(node, types, answers.put, matched.note)
    assert matched.wait(LIMIT_S)
    for index in range(2):
        asked.ask(index, round(LIMIT_S * 1e9))
        assert asked.is_right(index, answers.get(timeout=LIMIT_S))
    node.close()
    refusals.wait_for()
    assert network.board.runs
    assert network.router.runs
    callbacks = ask_status(network.transport, "board0")["callbacks"]
    assert {name: callback["failed"] for name, callback in callbacks.items()} == dict.fromkeys(EXCHANGES, 0)
