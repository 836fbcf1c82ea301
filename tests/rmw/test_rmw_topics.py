"""Publishers and subscriptions: what goes over the wire, what arrives, and what is refused."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from two_sessions import QOS, TwoSessions, types

from reconros_zenoh.errors import BadMessageError, TransportError
from reconros_zenoh.ros.attachment import Attachment
from reconros_zenoh.ros.graph import gid
from reconros_zenoh.ros.qos import Durability, QosProfile

if TYPE_CHECKING:
    from reconros_zenoh.rmw.received import Received

WORD = "std_msgs::msg::dds_::UInt32_"


@pytest.fixture
def sessions() -> TwoSessions:
    return TwoSessions()


def word(number: int) -> Any:
    return types().message("std_msgs/msg/UInt32").cls(data=number)


def subscribe(sessions: TwoSessions, topic: str = "angle", **more: Any) -> list[Received]:
    got: list[Received] = []
    sessions.there.node("listener").subscription(
        types().message("std_msgs/msg/UInt32"), topic, got.append, **more
    )
    return got


def publisher(sessions: TwoSessions, topic: str = "angle", **more: Any) -> Any:
    return sessions.here.node("talker").publisher(types().message("std_msgs/msg/UInt32"), topic, **more)


def test_a_message_arrives_decoded(sessions: TwoSessions) -> None:
    got = subscribe(sessions)
    publisher(sessions).publish(word(7))
    sessions.settle()
    (received,) = got
    assert received.message == word(7)
    assert received.size == 8
    assert received.responder is None


def test_a_message_in_parts_is_as_large_as_its_bytes_on_the_wire(sessions: TwoSessions) -> None:
    image = types().message("std_msgs/msg/UInt8MultiArray")
    layout = types().message("std_msgs/msg/MultiArrayLayout").cls(dim=[], data_offset=0)
    got: list[Received] = []
    sessions.there.node("listener").subscription(image, "image", got.append)
    sent = image.cls(layout=layout, data=np.arange(100_000, dtype=np.uint32).astype(np.uint8))
    sessions.here.node("talker").publisher(image, "image").publish(sent)
    sessions.settle()
    assert got[0].size == sum(len(part) for part in image.encode(sent))
    assert np.array_equal(got[0].message.data, sent.data)


def test_messages_come_in_order(sessions: TwoSessions) -> None:
    got = subscribe(sessions)
    talker = publisher(sessions)
    for number in range(20):
        talker.publish(word(number))
    sessions.settle()
    assert [received.message.data for received in got] == list(range(20))


def test_attachments_are_numbered_from_one_and_stamped_and_carry_the_gid_of_the_token(
    sessions: TwoSessions,
) -> None:
    samples = sessions.listen("0/angle/**")
    talker = publisher(sessions)
    for now_ns in (1000, 1700, 1600):
        sessions.here_ns = now_ns
        talker.publish(word(1))
    sessions.settle()
    attachments = [Attachment.decode(sample.attachment) for sample in samples]
    assert [a.sequence_number for a in attachments] == [1, 2, 3]
    assert [a.source_timestamp_ns for a in attachments] == [1000, 1700, 1600]
    (token,) = sessions.tokens("@ros2_lv/0/a1/*/*/MP/**")
    assert {a.gid for a in attachments} == {gid(token)}


def test_each_publisher_counts_for_itself(sessions: TwoSessions) -> None:
    samples = sessions.listen("0/**")
    first, second = publisher(sessions, "angle"), publisher(sessions, "angle")
    for talker in (first, second, first):
        talker.publish(word(1))
    sessions.settle()
    attachments = [Attachment.decode(sample.attachment) for sample in samples]
    assert [a.sequence_number for a in attachments] == [1, 1, 2]
    assert attachments[0].gid == attachments[2].gid != attachments[1].gid


def test_the_key_is_domain_topic_type_and_hash(sessions: TwoSessions) -> None:
    samples = sessions.listen("**")
    sessions.here.node("talker", "/lab").publisher(types().message("std_msgs/msg/UInt32"), "angle").publish(
        word(1)
    )
    sessions.settle()
    assert samples[0].key == f"0/lab/angle/{WORD}/{types().message('std_msgs/msg/UInt32').type_hash}"


def test_transit_is_the_clock_of_the_receiver_less_the_time_stamp(sessions: TwoSessions) -> None:
    got = subscribe(sessions)
    talker = publisher(sessions)
    for here_ns, there_ns in [(1000, 1250), (1000, 1000), (1000, 900)]:
        sessions.here_ns, sessions.there_ns = here_ns, there_ns
        talker.publish(word(1))
        sessions.settle()
    assert [received.transit_ns for received in got] == [250, 0, -100]


def test_a_late_subscription_gets_the_last_messages_of_a_transient_local_publisher(
    sessions: TwoSessions,
) -> None:
    latched = QosProfile(durability=Durability.TRANSIENT_LOCAL, depth=2)
    talker = publisher(sessions, qos=latched)
    for number in range(4):
        talker.publish(word(number))
    got = subscribe(sessions, qos=latched)
    sessions.settle()
    assert [received.message.data for received in got] == [2, 3]


def test_a_publisher_is_told_of_its_first_and_its_last_subscription(sessions: TwoSessions) -> None:
    changes: list[bool] = []
    publisher(sessions, on_matching=changes.append)
    sessions.settle()
    listener = sessions.there.node("listener")
    listener.subscription(types().message("std_msgs/msg/UInt32"), "angle", lambda _: None)
    sessions.settle()
    listener.close()
    sessions.settle()
    assert changes == [False, True, False]


def test_a_closed_subscription_hears_nothing_more(sessions: TwoSessions) -> None:
    got: list[Received] = []
    subscription = sessions.there.node("listener").subscription(
        types().message("std_msgs/msg/UInt32"), "angle", got.append
    )
    talker = publisher(sessions)
    talker.publish(word(1))
    subscription.close()
    subscription.close()
    talker.publish(word(2))
    sessions.settle()
    assert got == []


def test_a_closed_publisher_cannot_publish(sessions: TwoSessions) -> None:
    talker = publisher(sessions)
    talker.close()
    talker.close()
    with pytest.raises(TransportError, match="is closed"):
        talker.publish(word(1))


def attachment(number: int = 1) -> bytes:
    return Attachment(number, 0, bytes(range(16))).encode()


UINT32_HASH = types().message("std_msgs/msg/UInt32").type_hash
GOOD_KEY = f"0/angle/{WORD}/{UINT32_HASH}"
GOOD = b"\x00\x01\x00\x00\x07\x00\x00\x00"

# key, payload and attachment on the wire; the reason under which it is counted, and what is said of it
BAD = {
    "foreign domain": (
        GOOD_KEY.replace("0/", "42/", 1),
        GOOD,
        attachment(),
        "foreign_domain",
        "sent in domain 42, this is domain 0",
    ),
    "other type hash": (
        f"0/angle/{WORD}/RIHS01_beef",
        GOOD,
        attachment(),
        "type_mismatch",
        f"has hash RIHS01_beef, ours {UINT32_HASH}",
    ),
    "no attachment": (GOOD_KEY, GOOD, None, "no_attachment", "has no attachment"),
    "short attachment": (GOOD_KEY, GOOD, attachment()[:-1], "no_attachment", "32 bytes instead of 33"),
    "truncated CDR": (GOOD_KEY, GOOD[:-1], attachment(), "truncated", "std_msgs/msg/UInt32, 7 bytes"),
    "no CDR": (
        GOOD_KEY,
        b"",
        attachment(),
        "truncated",
        "no encapsulation header",
    ),
    "big endian": (GOOD_KEY, b"\x00\x00" + GOOD[2:], attachment(), "foreign_encoding", "CDR big endian"),
    "refused by the callback's check": (GOOD_KEY, GOOD[:4] + b"\x0d\0\0\0", attachment(), "leg", "13 legs"),
}


def refuse_thirteen(message: Any) -> None:
    if message.data == 13:
        raise BadMessageError("leg", "13 legs")


@pytest.mark.parametrize(("key", "payload", "attached", "reason", "detail"), BAD.values(), ids=BAD)
def test_a_bad_message_is_counted_by_reason_and_logged_once(
    sessions: TwoSessions,
    caplog: pytest.LogCaptureFixture,
    key: str,
    payload: bytes,
    attached: bytes | None,
    reason: str,
    detail: str,
) -> None:
    got = subscribe(sessions, check=refuse_thirteen)
    wire = sessions.network.transport("c3")
    bad = wire.publish(key, QOS)
    for _ in range(3):
        bad.put((payload,), attached)
    wire.publish(GOOD_KEY, QOS).put((GOOD,), attachment())
    sessions.settle()
    assert [received.message.data for received in got] == [7], "the good message passes"
    assert sessions.there.rejections.counts() == {reason: 3}
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert key in record.getMessage()
    assert f"{reason}: " in record.getMessage()
    assert detail in record.getMessage()


def test_another_topic_is_none_of_its_business(sessions: TwoSessions) -> None:
    got = subscribe(sessions)
    wire = sessions.network.transport("c3")
    for key in (
        GOOD_KEY.replace("angle", "legangle"),
        GOOD_KEY.replace("UInt32", "Int32"),
        f"0/lab/{GOOD_KEY[2:]}",
    ):
        wire.publish(key, QOS).put((GOOD,), attachment())
    sessions.settle()
    assert got == []
    assert sessions.there.rejections.counts() == {}


def test_each_sender_is_logged_for_itself(sessions: TwoSessions, caplog: pytest.LogCaptureFixture) -> None:
    subscribe(sessions, check=refuse_thirteen)
    first, second = publisher(sessions), publisher(sessions)
    for talker in (first, second, first, second):
        talker.publish(word(13))
    sessions.settle()
    assert sessions.there.rejections.counts() == {"leg": 4}
    gids = [gid(token).hex() for token in sessions.tokens("@ros2_lv/0/a1/*/*/MP/**")]
    logged = [record.getMessage() for record in caplog.records]
    assert len(logged) == 2
    assert all(any(f"publisher {each} " in text for text in logged) for each in gids)


def test_what_a_check_raises_by_mistake_does_not_harm_the_subscription(
    sessions: TwoSessions, caplog: pytest.LogCaptureFixture
) -> None:
    def check(message: Any) -> None:
        if message.data == 0:
            raise ZeroDivisionError

    got = subscribe(sessions, check=check)
    talker = publisher(sessions)
    for number in (0, 1):
        talker.publish(word(number))
    sessions.settle()
    assert [received.message.data for received in got] == [1]
    assert [record.name for record in caplog.records] == ["reconros_zenoh.transport.guard"]
