"""What every Transport does, and then what only Zenoh can get wrong."""

from __future__ import annotations

import re
import socket
from contextlib import ExitStack
from itertools import count
from threading import Condition, Event, Thread, get_ident, local
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pytest
from links import as_another_host_does, slow_link

from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import TransportError, UsageError
from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.ros.qos import Durability, History, QosProfile, Reliability
from reconros_zenoh.transport import zenoh_session
from reconros_zenoh.transport.simulated import SimulatedNetwork
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from reconros_zenoh.transport.base import Request, Sample, Transport

LIMIT_S = 30
LIMIT_NS = LIMIT_S * 10**9
DEFAULT = QosProfile()
LATCHED = QosProfile(durability=Durability.TRANSIENT_LOCAL, depth=3)
KEY = "0/chatter/std_msgs::msg::dds_::String_/RIHS01_0"


class Inbox:
    """Keeps what a sink or callback was called with."""

    def __init__(self, changed: Condition) -> None:
        self.items: list[Any] = []
        self.changed = changed

    def put(self, *item: Any) -> None:
        with self.changed:
            self.items.append(item[0] if len(item) == 1 else item)
            self.changed.notify_all()

    def put_text(self, sample: Sample) -> None:
        self.put(bytes(sample.payload).decode())

    def has(self, *items: Any) -> Callable[[], bool]:
        return lambda: self.items == list(items)


class Network(Protocol):
    """Sessions that hear of each other, and a way to wait."""

    def session(self) -> Transport: ...
    def inbox(self) -> Inbox: ...
    def wait(self, condition: Callable[[], bool]) -> None: ...


class VirtualNetwork:
    def __init__(self) -> None:
        self.environment = VirtualEnvironment()
        self._network = SimulatedNetwork(self.environment)
        self._ids = count(1)

    def session(self) -> Transport:
        return self._network.transport(f"{next(self._ids):x}")

    def inbox(self) -> Inbox:
        return Inbox(Condition())

    def wait(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self.environment.step()  # fails when nothing is left to happen


class RoutedNetwork:
    """Sessions that hear of each other through the router only, as on several hosts."""

    def __init__(self, endpoint: str, stack: ExitStack) -> None:
        self._endpoint = endpoint
        self._stack = stack
        self._changed = Condition()

    def session(self) -> ZenohTransport:
        return self._stack.enter_context(ZenohTransport.open(self._endpoint, timeout_s=LIMIT_S))

    def inbox(self) -> Inbox:
        return Inbox(self._changed)

    def wait(self, condition: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(condition, LIMIT_S)


class ZenohNetwork(RoutedNetwork):
    """Sessions of one host, which are linked to each other."""

    def __init__(self, endpoint: str, stack: ExitStack) -> None:
        super().__init__(endpoint, stack)
        self._sessions: list[ZenohTransport] = []

    def session(self) -> ZenohTransport:
        """Return a session linked to all others: before, Zenoh also sends what nobody subscribed to."""
        links = self.inbox()
        session = super().session()
        listener = session.session.info.declare_transport_events_listener(links.put, history=True)
        others = {other.session_id for other in self._sessions}
        self.wait(lambda: {str(event.transport.zid) for event in links.items} >= others)
        listener.undeclare()
        self._sessions.append(session)
        return session


@pytest.fixture(scope="module")
def router() -> Iterator[str]:
    endpoint = free_endpoint()
    with ZenohRouter.open(endpoint):
        yield endpoint


@pytest.fixture
def without_shared_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_session, "has_shared_memory", lambda: False)


@pytest.fixture(params=["simulated", "zenoh", "zenoh between hosts"])
def network(request: pytest.FixtureRequest) -> Iterator[Network]:
    if request.param == "simulated":
        yield VirtualNetwork()
        return
    router = request.getfixturevalue("router")
    with ExitStack() as stack:
        if request.param == "zenoh":
            yield ZenohNetwork(router, stack)
        else:
            yield RoutedNetwork(as_another_host_does(router), stack)


def know(network: Network, session: Transport, *others: Transport) -> None:
    """Wait until `session` knows all that `others` have declared so far: it knows what they declare now."""
    tokens = network.inbox()
    watch = session.watch_tokens("known/*", tokens.put)
    for other in others:
        other.declare_token(f"known/{other.session_id}")
    network.wait(lambda: {key for key, _ in tokens.items} >= {f"known/{o.session_id}" for o in others})
    watch.close()


def test_a_message_arrives_with_key_attachment_and_joined_parts(network: Network) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    there.subscribe(KEY, inbox.put, DEFAULT)
    know(network, here, there)

    here.publish(KEY, DEFAULT).put([b"\x00\x01", bytearray(b"abc"), memoryview(b"xdefx")[1:4]], b"a" * 33)
    network.wait(lambda: len(inbox.items) == 1)

    (sample,) = inbox.items  # read long after the sink returned
    assert (sample.key, sample.attachment) == (KEY, b"a" * 33)
    payload = sample.payload
    assert payload == b"\x00\x01abcdef"
    assert (payload.format, payload.readonly, payload.ndim) == ("B", True, 1)


@pytest.mark.parametrize("parts", [[], [b""], [b"", b""]], ids=["no part", "one", "two"])
def test_an_empty_payload_without_attachment_arrives(network: Network, parts: list[bytes]) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    there.subscribe(KEY, lambda sample: inbox.put(bytes(sample.payload), sample.attachment), DEFAULT)
    know(network, here, there)

    here.publish(KEY, DEFAULT).put(parts, None)
    network.wait(inbox.has((b"", None)))


@pytest.mark.parametrize(
    "qos",
    [
        DEFAULT,
        QosProfile(Reliability.BEST_EFFORT),
        QosProfile(history=History.KEEP_ALL),
        LATCHED,
        QosProfile(Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL),
    ],
    ids=lambda qos: qos.encode(),
)
def test_messages_of_a_publisher_keep_their_order(network: Network, qos: QosProfile) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    there.subscribe(KEY, inbox.put_text, qos)
    know(network, here, there)

    publisher = here.publish(KEY, qos)
    for number in range(50):
        publisher.put([str(number).encode()], None)
    network.wait(inbox.has(*map(str, range(50))))


def test_a_large_payload_arrives_unchanged(network: Network) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    there.subscribe(KEY, inbox.put, DEFAULT)
    know(network, here, there)
    publisher = here.publish(KEY, DEFAULT)
    generator = np.random.default_rng(1)

    for number in range(3):  # later frames reuse the memory of the earlier ones
        image = generator.integers(0, 256, 6 * 2**20, dtype=np.uint8)
        publisher.put([b"header", memoryview(image), bytearray(b"trailer")], None)
        network.wait(lambda number=number: len(inbox.items) == number + 1)
        assert inbox.items[number].payload == b"header" + image.tobytes() + b"trailer"
        inbox.items[number] = None


def test_a_reader_that_keeps_its_samples_stops_no_publisher(network: Network) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    whole = QosProfile(history=History.KEEP_ALL)  # loses nothing on a busy host
    there.subscribe(KEY, inbox.put, whole)
    know(network, here, there)
    publisher = here.publish(KEY, whole)

    sent = [bytes([number]) * 2**20 for number in range(12)]
    for number, payload in enumerate(sent):
        publisher.put([payload], None)
        network.wait(lambda number=number: len(inbox.items) == number + 1)
    assert [sample.payload for sample in inbox.items] == sent


@pytest.mark.parametrize("usual_key", [None, "0/a/type/hash", "0/c/type"])
def test_a_wildcard_subscription_gets_every_matching_key(network: Network, usual_key: str | None) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    there.subscribe(
        "0/*/type/**", lambda sample: inbox.put(sample.key, bytes(sample.payload)), DEFAULT, usual_key
    )
    know(network, here, there)

    for key in ("0/a/type/hash", "1/a/type/hash", "0/a/b/type/hash", "0/b/type"):
        here.publish(key, DEFAULT).put([b"1"], None)
    network.wait(inbox.has(("0/a/type/hash", b"1"), ("0/b/type", b"1")))


def test_every_subscriber_gets_the_message_also_in_the_session_of_the_publisher(network: Network) -> None:
    here, there, elsewhere = network.session(), network.session(), network.session()
    inboxes = [network.inbox() for _ in range(4)]
    for session, inbox in zip((here, there, elsewhere, elsewhere), inboxes, strict=True):
        session.subscribe(KEY, inbox.put_text, DEFAULT)
    know(network, here, there, elsewhere)

    here.publish(KEY, DEFAULT).put([b"to all"], None)
    for inbox in inboxes:
        network.wait(inbox.has("to all"))


def test_a_closed_subscription_gets_nothing_more(network: Network) -> None:
    here, there = network.session(), network.session()
    closed, witness = network.inbox(), network.inbox()
    subscription = there.subscribe(KEY, closed.put_text, DEFAULT)
    there.subscribe(KEY, witness.put_text, DEFAULT)
    know(network, here, there)
    publisher = here.publish(KEY, DEFAULT)

    publisher.put([b"before"], None)
    network.wait(lambda: len(closed.items) == len(witness.items) == 1)
    subscription.close()
    publisher.put([b"after"], None)
    network.wait(witness.has("before", "after"))
    assert closed.items == ["before"]


def test_a_sink_may_close_its_own_subscription(network: Network) -> None:
    here, there = network.session(), network.session()
    once, witness = network.inbox(), network.inbox()

    def sink(sample: Sample) -> None:
        subscription.close()
        once.put_text(sample)

    subscription = there.subscribe(KEY, sink, DEFAULT)
    there.subscribe(KEY, witness.put_text, DEFAULT)
    know(network, here, there)
    publisher = here.publish(KEY, DEFAULT)
    publisher.put([b"1"], None)
    publisher.put([b"2"], None)
    network.wait(witness.has("1", "2"))
    assert once.items == ["1"]


@pytest.mark.parametrize("qos", [DEFAULT, LATCHED], ids=["volatile", "latched"])
def test_a_sink_may_publish_what_it_hears_itself(network: Network, qos: QosProfile) -> None:
    session, inbox = network.session(), network.inbox()
    publisher = session.publish(KEY, qos)

    def echo(sample: Sample) -> None:
        if not sample.payload:
            for _ in range(300):  # more than Zenoh lets wait for a thread
                publisher.put([b"x"], None)
        inbox.put_text(sample)

    session.subscribe(KEY, echo, qos)
    publisher.put([], None)
    network.wait(lambda: sorted(inbox.items) == ["", *"x" * 300])


def test_a_sink_that_raises_is_logged_once_and_goes_on(
    network: Network, caplog: pytest.LogCaptureFixture
) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()

    def sink(sample: Sample) -> None:
        inbox.put_text(sample)
        raise ValueError("no such encoding")

    there.subscribe(KEY, sink, DEFAULT)
    know(network, here, there)
    publisher = here.publish(KEY, DEFAULT)
    for text in (b"1", b"2", b"3"):
        publisher.put([text], None)
    network.wait(inbox.has("1", "2", "3"))

    (record,) = caplog.records
    assert KEY in record.getMessage()
    assert "no such encoding" in caplog.text


def test_what_is_closed_raises_when_it_is_used(network: Network) -> None:
    session = network.session()
    publisher, querier = session.publish(KEY, DEFAULT), session.request("service")
    other, other_querier = session.publish(KEY, LATCHED), session.request("service")
    publisher.close()
    querier.close()
    with pytest.raises(TransportError, match="chatter"):
        publisher.put([b"late"], None)
    with pytest.raises(TransportError, match="service"):
        querier.get([b"late"], None, lambda _: None, LIMIT_NS)

    session.close()
    for use in (
        lambda: other.put([b"late"], None),
        lambda: other_querier.get([b"late"], None, lambda _: None, LIMIT_NS),
        lambda: session.publish(KEY, DEFAULT),
        lambda: session.subscribe(KEY, lambda _: None, LATCHED),
        lambda: session.serve(KEY, lambda _: None),
        lambda: session.request(KEY),
        lambda: session.declare_token(KEY),
        lambda: session.tokens(KEY, LIMIT_NS),
        lambda: session.watch_tokens(KEY, lambda _key, _alive: None),
    ):
        with pytest.raises(TransportError):
            use()


def test_a_key_that_is_none_raises(network: Network) -> None:
    session = network.session()
    for declare in (
        lambda: session.publish("/chatter", DEFAULT),
        lambda: session.subscribe("a//b", lambda _: None, DEFAULT),
        lambda: session.request(""),
        lambda: session.request("control/*"),
        lambda: session.publish("0/**", LATCHED),
        lambda: session.tokens("a?b", LIMIT_NS),
    ):
        with pytest.raises(TransportError):
            declare()


@pytest.mark.parametrize("qos", [DEFAULT, LATCHED], ids=["volatile", "transient local"])
def test_a_publisher_hears_whether_it_has_a_subscriber(network: Network, qos: QosProfile) -> None:
    here, there = network.session(), network.session()
    matching = network.inbox()
    here.publish(KEY, qos, matching.put)
    network.wait(matching.has(False))
    first = there.subscribe("0/chatter/**", lambda _: None, qos)
    network.wait(matching.has(False, True))
    second = here.subscribe(KEY, lambda _: None, qos)
    first.close()
    second.close()
    network.wait(matching.has(False, True, False))

    there.subscribe(KEY, lambda _: None, qos)
    network.wait(matching.has(False, True, False, True))
    late = network.inbox()
    here.publish(KEY, qos, late.put)
    network.wait(late.has(True))


def test_a_querier_hears_whether_it_has_a_server(network: Network) -> None:
    here, there = network.session(), network.session()
    matching = network.inbox()
    here.request("service", matching.put)
    network.wait(matching.has(False))
    server = there.serve("service", lambda _: None)
    network.wait(matching.has(False, True))
    server.close()
    network.wait(matching.has(False, True, False))


@pytest.mark.parametrize("reliability", list(Reliability), ids=lambda reliability: reliability.name)
def test_a_late_subscriber_gets_the_last_messages_once(network: Network, reliability: Reliability) -> None:
    qos = QosProfile(reliability, Durability.TRANSIENT_LOCAL, depth=3)
    here, there, third = network.session(), network.session(), network.session()
    early = network.inbox()
    third.subscribe(KEY, early.put_text, QosProfile(reliability))
    know(network, here, there, third)
    publisher = here.publish(KEY, qos)
    for number in range(5):
        publisher.put([str(number).encode()], None)
    network.wait(early.has("0", "1", "2", "3", "4"))  # none is on its way: a token would overtake messages
    know(network, there, here)

    late, last, volatile = network.inbox(), network.inbox(), network.inbox()
    there.subscribe(KEY, volatile.put_text, QosProfile(reliability))
    there.subscribe(KEY, late.put_text, qos)
    there.subscribe(KEY, last.put_text, QosProfile(reliability, Durability.TRANSIENT_LOCAL, depth=1))
    network.wait(late.has("2", "3", "4"))
    network.wait(last.has("4"))
    know(network, here, there)
    publisher.put([b"5"], None)
    network.wait(late.has("2", "3", "4", "5"))
    network.wait(last.has("4", "5"))
    network.wait(volatile.has("5"))


def test_a_late_publisher_reaches_a_transient_local_subscriber(network: Network) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    there.subscribe(KEY, inbox.put_text, LATCHED)
    publisher = here.publish(KEY, LATCHED)
    publisher.put([b"at once"], None)
    network.wait(inbox.has("at once"))


def test_a_transient_local_subscriber_gets_volatile_messages(network: Network) -> None:
    here, there = network.session(), network.session()
    inbox = network.inbox()
    there.subscribe(KEY, inbox.put_text, LATCHED)
    know(network, here, there)
    here.publish(KEY, DEFAULT).put([b"volatile"], None)
    network.wait(inbox.has("volatile"))


def test_a_request_is_answered_and_over(network: Network) -> None:
    here, there = network.session(), network.session()
    replies = network.inbox()

    def add(request: Request) -> None:
        replies.put(request.key, request.attachment, bytes(request.read()))
        request.reply([b"\x00\x01", memoryview(b"sum")], b"b" * 33)

    there.serve("0/add/type/hash", add)
    know(network, here, there)
    here.request("0/add/type/hash").get([b"2", b"+3"], b"a" * 33, replies.put, LIMIT_NS)
    network.wait(lambda: len(replies.items) == 3)
    request, reply, end = replies.items
    assert request == ("0/add/type/hash", b"a" * 33, b"2+3")
    assert (reply.payload, reply.attachment, reply.error) == (b"\x00\x01sum", b"b" * 33, None)
    assert end is None


def test_large_request_and_reply_arrive_unchanged(network: Network) -> None:
    here, there = network.session(), network.session()
    replies = network.inbox()
    image = bytes(range(256)) * 4096
    there.serve("service", lambda request: request.reply([request.read(), b"!"], None))
    know(network, here, there)
    here.request("service").get([image], None, replies.put, LIMIT_NS)
    network.wait(lambda: len(replies.items) == 2)
    assert replies.items[0].payload == image + b"!"


def test_a_request_without_a_server_is_over(network: Network) -> None:
    ends = network.inbox()
    network.session().request("nobody").get([b""], None, ends.put, LIMIT_NS)
    network.wait(ends.has(None))


def test_a_querier_neither_hears_of_a_server_that_is_not_complete_nor_asks_it(network: Network) -> None:
    here, there = network.session(), network.session()
    matching, requests, ends = network.inbox(), network.inbox(), network.inbox()
    there.serve("*/sorter", requests.put, complete=False)
    there.serve("0/sorter", lambda request: request.reply([b"sorted"], None))
    know(network, here, there)
    here.request("1/sorter", matching.put).get([b""], None, ends.put, LIMIT_NS)
    network.wait(ends.has(None))
    here.request("0/sorter").get([b""], None, ends.put, LIMIT_NS)
    network.wait(lambda: len(ends.items) == len([None, "sorted", None]))
    assert ends.items[1].payload == b"sorted"
    assert matching.items == [False]
    assert requests.items == []


def test_a_request_that_no_server_keeps_is_over_before_its_time(network: Network) -> None:
    here, there = network.session(), network.session()
    requests, ends = network.inbox(), network.inbox()
    there.serve("forgetful", lambda _: None)
    there.serve("retentive", requests.put)
    know(network, here, there)
    here.request("retentive").get([b""], None, lambda _: ends.put("retentive"), LIMIT_NS)
    here.request("forgetful").get([b""], None, lambda _: ends.put("forgetful"), LIMIT_NS)
    network.wait(lambda: len(ends.items) > 0)
    assert ends.items[0] == "forgetful"


def test_a_server_answers_with_an_error(network: Network) -> None:
    here, there = network.session(), network.session()
    replies = network.inbox()
    there.serve("service", lambda request: request.reply_error("Timeout"))
    know(network, here, there)
    here.request("service").get([b""], None, replies.put, LIMIT_NS)
    network.wait(replies.has((None, None, "Timeout"), None))


def test_a_request_is_answered_later_from_another_thread_and_only_once(network: Network) -> None:
    here, there = network.session(), network.session()
    requests, replies = network.inbox(), network.inbox()
    there.serve("service", requests.put)
    know(network, here, there)
    here.request("service").get([b"question"], None, replies.put, LIMIT_NS)
    network.wait(lambda: len(requests.items) == 1)
    (request,) = requests.items

    thread = Thread(target=lambda: request.reply([request.read(), b"!"], None))
    thread.start()
    thread.join()
    network.wait(replies.has((b"question!", None, None), None))
    with pytest.raises(TransportError, match="answered already"):
        request.reply([b"again"], None)
    with pytest.raises(TransportError, match="answered already"):
        request.reply_error("again")


def test_every_server_answers_and_then_the_request_is_over(network: Network) -> None:
    here, there, elsewhere = network.session(), network.session(), network.session()
    replies = network.inbox()
    for session, answer in ((there, b"1"), (elsewhere, b"2"), (here, b"3")):
        session.serve("service", lambda request, answer=answer: request.reply([answer], None))
    know(network, here, there, elsewhere)
    here.request("service").get([b""], None, replies.put, LIMIT_NS)
    network.wait(lambda: None in replies.items)
    assert replies.items[-1] is None
    assert sorted(bytes(reply.payload) for reply in replies.items[:-1]) == [b"1", b"2", b"3"]


def test_a_timeout_ends_a_request_and_a_later_reply_is_lost(network: Network) -> None:
    here, there = network.session(), network.session()
    requests, replies = network.inbox(), network.inbox()
    there.serve("service", requests.put)
    know(network, here, there)
    querier = here.request("service")
    querier.get([b"slow"], None, replies.put, 10**8)
    network.wait(lambda: replies.items == [None] and len(requests.items) == 1)
    requests.items[0].reply([b"too late"], None)
    querier.get([b"fast"], None, replies.put, LIMIT_NS)
    network.wait(lambda: len(requests.items) == 2)
    requests.items[1].reply([b"in time"], None)
    network.wait(replies.has(None, (b"in time", None, None), None))


def test_a_closed_querier_hears_of_no_reply(network: Network) -> None:
    here, there = network.session(), network.session()
    requests, closed, witness = network.inbox(), network.inbox(), network.inbox()
    there.serve("service", requests.put)
    know(network, here, there)
    querier, other = here.request("service"), here.request("service")
    querier.get([b"1"], None, closed.put, LIMIT_NS)
    other.get([b"2"], None, witness.put, LIMIT_NS)
    network.wait(lambda: len(requests.items) == 2)
    querier.close()
    for request in requests.items:
        request.reply([b"answer"], None)
    network.wait(witness.has((b"answer", None, None), None))
    assert closed.items == []


def test_a_wildcard_server_gets_every_matching_request(network: Network) -> None:
    here, there = network.session(), network.session()
    replies = network.inbox()
    there.serve("control/**", lambda request: request.reply([request.key.encode()], None))
    know(network, here, there)
    for key in ("control/1/load", "elsewhere", "control/2/load"):
        here.request(key).get([], None, replies.put, LIMIT_NS)
        network.wait(lambda: replies.items[-1:] == [None])
        replies.items[-1:] = []
    assert [bytes(reply.payload) for reply in replies.items] == [b"control/1/load", b"control/2/load"]


def test_tokens_are_seen_by_those_who_ask_and_those_who_watch(network: Network) -> None:
    here, there = network.session(), network.session()
    early = network.inbox()
    here.watch_tokens("@ros2_lv/0/**", early.put)
    first = there.declare_token("@ros2_lv/0/1/NN")
    there.declare_token("@ros2_lv/1/1/NN")
    own = here.declare_token("@ros2_lv/0/2/NN")
    alive = {("@ros2_lv/0/1/NN", True), ("@ros2_lv/0/2/NN", True)}
    network.wait(lambda: set(early.items) == alive)

    assert sorted(here.tokens("@ros2_lv/0/**", LIMIT_NS)) == ["@ros2_lv/0/1/NN", "@ros2_lv/0/2/NN"]
    assert here.tokens("@ros2_lv/2/**", LIMIT_NS) == []
    late = network.inbox()
    watch = here.watch_tokens("@ros2_lv/0/**", late.put)
    network.wait(lambda: set(late.items) == alive)
    # A Zenoh router may still be about to tell the late watch of a token that goes now: it would come again.
    know(network, here, there)

    first.close()
    network.wait(lambda: ("@ros2_lv/0/1/NN", False) in late.items)
    watch.close()
    own.close()
    gone = {("@ros2_lv/0/1/NN", False), ("@ros2_lv/0/2/NN", False)}
    network.wait(lambda: set(early.items) == alive | gone)
    assert len(early.items) == 4
    assert len(late.items) == 3
    assert here.tokens("@ros2_lv/0/**", LIMIT_NS) == []


def test_tokens_go_with_their_session(network: Network) -> None:
    here, there = network.session(), network.session()
    changes = network.inbox()
    here.watch_tokens("lv/*", changes.put)
    there.declare_token("lv/1")
    network.wait(changes.has(("lv/1", True)))
    there.close()
    network.wait(changes.has(("lv/1", True), ("lv/1", False)))


@pytest.mark.parametrize("order", ["forwards", "backwards", "transport first", "server's transport first"])
def test_close_works_in_every_order_and_twice(network: Network, order: str) -> None:
    here, there = network.session(), network.session()
    inbox, requests = network.inbox(), network.inbox()
    declarations: list[Any] = [
        there.subscribe(KEY, inbox.put_text, LATCHED),
        there.subscribe("**", inbox.put_text, DEFAULT),
        there.serve("service", requests.put),
        here.publish(KEY, LATCHED, lambda _: None),
        here.publish(KEY, DEFAULT, lambda _: None),
        here.request("service", lambda _: None),
        here.declare_token("token"),
        there.watch_tokens("**", lambda _key, _alive: None),
        here,
        there,
    ]
    know(network, here, there)
    declarations[5].get([b"pending"], None, lambda _: None, LIMIT_NS)
    network.wait(lambda: len(requests.items) == 1)
    if order == "backwards":
        declarations.reverse()
    elif order == "transport first":
        declarations.sort(key=lambda declaration: declaration is not here)
    elif order == "server's transport first":
        declarations.sort(key=lambda declaration: declaration is not there)
    for declaration in declarations * 2:
        declaration.close()


def test_a_session_has_the_id_that_graph_tokens_need(network: Network) -> None:
    ids = [network.session().session_id for _ in range(2)]
    assert all(re.fullmatch("[1-9a-f][0-9a-f]{0,31}", session_id) for session_id in ids)
    assert ids[0] != ids[1]


def test_a_publisher_is_closed_while_another_thread_sends(router: str) -> None:
    with ZenohTransport.open(router) as session:
        inbox = Inbox(Condition())
        publisher = session.publish(KEY, DEFAULT)
        refused = []

        def send_until_refused() -> None:
            while not refused:
                try:
                    publisher.put([bytes(100_000)], None)
                except TransportError as error:
                    refused.append(error)
                inbox.put(None)

        thread = Thread(target=send_until_refused, daemon=True)
        thread.start()
        with inbox.changed:
            assert inbox.changed.wait_for(lambda: len(inbox.items) > 10, LIMIT_S)
        publisher.close()
        thread.join(LIMIT_S)
        assert not thread.is_alive()
        assert KEY in str(refused[0])


@pytest.mark.usefixtures("without_shared_memory")
def test_a_callback_may_publish_what_no_shared_memory_takes(router: str) -> None:
    whole = QosProfile(history=History.KEEP_ALL)  # waits rather than loses
    inbox = Inbox(Condition())
    with ZenohTransport.open(router) as here, ZenohTransport.open(router) as there:
        asked, answered = Event(), Event()
        echo = there.publish("echo", whole, lambda matching: answered.set() if matching else None)
        there.subscribe(KEY, lambda sample: echo.put([sample.payload], None), whole)
        here.subscribe("echo", lambda sample: inbox.put(len(sample.payload)), whole)
        publisher = here.publish(KEY, whole, lambda matching: asked.set() if matching else None)
        assert asked.wait(LIMIT_S)
        assert answered.wait(LIMIT_S)
        for size in (2**20, 2**21, 3):
            publisher.put([bytes(size)], None)
            with inbox.changed:
                assert inbox.changed.wait_for(lambda size=size: size in inbox.items, LIMIT_S)
    assert len(inbox.items) == 3


@pytest.mark.usefixtures("without_shared_memory")
def test_a_large_message_waits_for_a_slow_link(router: str) -> None:
    inbox = Inbox(Condition())
    message = np.random.default_rng(0).bytes(6_000_000)
    with slow_link(router) as far, ExitStack() as sessions:
        here = sessions.enter_context(ZenohTransport.open(router))
        there = sessions.enter_context(ZenohTransport.open(far))
        matched = Event()
        here.subscribe(KEY, inbox.put, DEFAULT)
        publisher = there.publish(KEY, DEFAULT, lambda matching: matched.set() if matching else None)
        assert matched.wait(LIMIT_S)
        publisher.put([message], None)
        with inbox.changed:
            assert inbox.changed.wait_for(lambda: len(inbox.items) == 1, LIMIT_S)
    assert inbox.items[0].payload == message


def test_a_thread_of_zenoh_keeps_its_state_from_one_callback_to_the_next(router: str) -> None:
    of_thread = local()
    inbox = Inbox(Condition())

    def note(_: Sample) -> None:
        inbox.put((get_ident(), hasattr(of_thread, "state")))
        of_thread.state = True

    with ZenohTransport.open(router) as here, ZenohTransport.open(router) as there:
        matched = Event()
        there.subscribe(KEY, note, DEFAULT)
        publisher = here.publish(KEY, DEFAULT, lambda matching: matched.set() if matching else None)
        assert matched.wait(LIMIT_S)
        for number in range(1, 11):  # more than Zenoh has threads
            publisher.put([b"x"], None)
            with inbox.changed:
                assert inbox.changed.wait_for(lambda number=number: len(inbox.items) == number, LIMIT_S)
    known = [kept for place, (ident, kept) in enumerate(inbox.items) if ident in dict(inbox.items[:place])]
    assert known
    assert all(known)


def test_a_session_that_cannot_take_leave_is_closed_all_the_same() -> None:
    class Left:
        def zid(self) -> str:
            return "1"

        def close(self) -> None:
            raise zenoh_session.zenoh.ZError("close operation timed out!")

    ZenohTransport(Left()).close()  # type: ignore[arg-type] # a session whose router's host has vanished


def test_no_router_is_said_in_one_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    endpoint = free_endpoint()
    with pytest.raises(TransportError) as caught:
        ZenohTransport.open(endpoint, timeout_s=0.3)
    assert str(caught.value) == (
        f"no Zenoh router at {endpoint}: start one with `reconros router --listen {endpoint}`"
    )
    assert capfd.readouterr() == ("", "")


def test_a_port_where_nobody_answers_is_no_router() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as mute,
        pytest.raises(TransportError, match="no Zenoh router"),
    ):
        ZenohTransport.open(f"tcp/127.0.0.1:{mute.getsockname()[1]}", timeout_s=0.3)


def test_a_port_in_use_is_named(router: str, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(TransportError, match="choose another endpoint") as caught:
        ZenohRouter.open(router)
    assert router in str(caught.value)
    assert "Address already in use" in str(caught.value)
    assert ".rs" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("endpoint", ["localhost", "tcp/", ""])
def test_what_is_no_endpoint_is_refused(endpoint: str) -> None:
    with pytest.raises(UsageError, match="not a Zenoh endpoint"):
        ZenohTransport.open(endpoint)
    with pytest.raises(UsageError, match="not a Zenoh endpoint"):
        ZenohRouter.open(endpoint)


@pytest.mark.parametrize(
    ("endpoint", "expected"),
    [
        ("tcp/127.0.0.1:7447", True),
        ("tcp/127.1.2.3:7447", True),
        ("tcp/localhost:7447", True),
        ("tcp/[::1]:7447", True),
        ("unixsock-stream//tmp/router.sock", True),
        ("tcp/10.0.0.7:7447", False),
        ("udp/10.0.0.7:7447?rel=0#iface=eth0", False),
        ("tcp/[fe80::1%eth0]:7447", False),
        ("tcp/router:7447", False),
    ],
)
def test_an_endpoint_tells_whether_it_is_of_this_host(endpoint: str, expected: bool) -> None:
    assert zenoh_session.is_of_this_host(endpoint) is expected


@pytest.mark.parametrize("seen_from", [str, as_another_host_does])
def test_sessions_find_a_router_that_comes_back(seen_from: Callable[[str], str]) -> None:
    endpoint = free_endpoint()
    changed = Condition()
    tokens = Inbox(changed)
    first = ZenohRouter.open(endpoint)
    with ZenohTransport.open(seen_from(endpoint)) as here:
        here.declare_token("lv/1")
        first.close()
        with ZenohRouter.open(endpoint), ZenohTransport.open(endpoint) as there:
            there.watch_tokens("lv/*", tokens.put)
            with changed:
                assert changed.wait_for(tokens.has(("lv/1", True)), LIMIT_S)
