"""Services and clients: requests, responses and error replies on the wire."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from two_sessions import TwoSessions, types

from reconros_zenoh.errors import BadMessageError, TransportError
from reconros_zenoh.ros.attachment import Attachment
from reconros_zenoh.ros.graph import gid

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.client import Client
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.transport.base import Reply, Request

SECOND_NS = 10**9


@pytest.fixture
def sessions() -> TwoSessions:
    return TwoSessions()


def set_bool() -> Any:
    return types().service("std_srvs/srv/SetBool")


def request(*, data: bool = True) -> Any:
    return set_bool().request.cls(data=data)


def response(message: str) -> Any:
    return set_bool().response.cls(success=True, message=message)


def serve(
    sessions: TwoSessions, sink: Callable[[Received], None], check: Callable[[Any], None] | None = None
) -> None:
    sessions.there.node("server").service(set_bool(), "switch", sink, check)


def respond(received: Received) -> None:
    assert received.responder is not None
    received.responder.respond_encoded(set_bool().response.encode(response(f"{received.message.data}")))


def client(sessions: TwoSessions) -> Client:
    return sessions.here.node("client").client(set_bool(), "switch")


def test_a_call_is_answered_once(sessions: TwoSessions) -> None:
    serve(sessions, respond)
    answers: list[Any] = []
    caller = client(sessions)
    caller.call(request(data=True), answers.append, SECOND_NS)
    caller.call(request(data=False), answers.append, SECOND_NS)
    sessions.environment.run(until=2 * SECOND_NS)
    assert answers == [response("True"), response("False")]


def test_what_a_server_gets(sessions: TwoSessions) -> None:
    got: list[Received] = []
    serve(sessions, got.append)
    sessions.there_ns = 1300
    client(sessions).call(request(), lambda _: None, SECOND_NS)
    sessions.settle()
    assert got[0].message == request()
    assert got[0].size == 5
    assert got[0].transit_ns == 300


def test_the_response_carries_number_and_gid_of_the_request_and_a_new_stamp(sessions: TwoSessions) -> None:
    waiting: list[Received] = []
    serve(sessions, waiting.append)
    replies: list[Reply | None] = []
    attached = Attachment(41, 1000, bytes(range(16)))
    key = client(sessions).key
    querier = sessions.network.transport("c3").request(key)
    querier.get(set_bool().request.encode(request()), attached.encode(), replies.append, SECOND_NS)
    sessions.settle()
    sessions.there_ns = 5000
    respond(waiting[0])
    sessions.settle()
    assert replies[0] is not None
    assert Attachment.decode(replies[0].attachment) == Attachment(41, 5000, bytes(range(16)))


def test_requests_are_numbered_from_one_and_carry_the_gid_of_the_client(sessions: TwoSessions) -> None:
    caller = client(sessions)
    seen: list[Attachment] = []

    def sink(request: Request) -> None:
        seen.append(Attachment.decode(request.attachment))
        request.reply_error("no")

    sessions.serve(caller.key, sink)
    for _ in range(2):
        caller.call(request(), lambda _: None, SECOND_NS)
    sessions.settle()
    (token,) = sessions.tokens("@ros2_lv/0/a1/*/*/SC/**")
    assert seen == [Attachment(1, 1000, gid(token)), Attachment(2, 1000, gid(token))]


def test_a_service_that_fails_says_why(sessions: TwoSessions) -> None:
    def fail(received: Received) -> None:
        assert received.responder is not None
        received.responder.fail("out of paper")

    serve(sessions, fail)
    answers: list[Any] = []
    client(sessions).call(request(), answers.append, SECOND_NS)
    sessions.environment.run(until=2 * SECOND_NS)
    (error,) = answers
    assert isinstance(error, TransportError)
    assert str(error) == "service /switch refused: out of paper"


def test_a_service_that_never_answers(sessions: TwoSessions) -> None:
    kept: list[Received] = []
    serve(sessions, kept.append)
    answers: list[tuple[int, Any]] = []
    client(sessions).call(request(), lambda a: answers.append((sessions.environment.now, a)), SECOND_NS)
    sessions.environment.run(until=2 * SECOND_NS)
    ((when_ns, error),) = answers
    assert when_ns == SECOND_NS
    assert isinstance(error, TransportError)
    assert str(error) == "no answer from service /switch"


def test_a_service_that_is_not_there(sessions: TwoSessions) -> None:
    answers: list[Any] = []
    client(sessions).call(request(), answers.append, SECOND_NS)
    sessions.settle()
    assert [str(answer) for answer in answers] == ["no answer from service /switch"]


def test_the_first_of_two_servers_is_heard(sessions: TwoSessions) -> None:
    for _ in range(2):
        serve(sessions, respond)
    answers: list[Any] = []
    client(sessions).call(request(), answers.append, SECOND_NS)
    sessions.environment.run(until=2 * SECOND_NS)
    assert answers == [response("True")]


def test_a_response_that_cannot_be_decoded(sessions: TwoSessions, caplog: pytest.LogCaptureFixture) -> None:
    caller = client(sessions)
    sessions.serve(caller.key, lambda request: request.reply((b"\x00\x01\x00\x00\x01",), None))
    answers: list[Any] = []
    caller.call(request(), answers.append, SECOND_NS)
    sessions.settle()
    (error,) = answers
    assert isinstance(error, BadMessageError)
    assert error.reason == "truncated"
    assert sessions.here.rejections.counts() == {"truncated": 1}
    assert len(caplog.records) == 1


def test_a_closed_client_is_not_told_of_an_answer_that_comes_later(sessions: TwoSessions) -> None:
    waiting: list[Received] = []
    serve(sessions, waiting.append)
    answers: list[Any] = []
    caller = client(sessions)
    caller.call(request(), answers.append, SECOND_NS)
    sessions.settle()
    caller.close()
    caller.close()
    respond(waiting[0])
    sessions.environment.run(until=2 * SECOND_NS)
    assert answers == []


def test_a_client_is_told_when_there_is_a_server(sessions: TwoSessions) -> None:
    changes: list[bool] = []
    sessions.here.node("client").client(set_bool(), "switch", changes.append)
    sessions.settle()
    node = sessions.there.node("server")
    node.service(set_bool(), "switch", respond)
    sessions.settle()
    node.close()
    sessions.settle()
    assert changes == [False, True, False]


def refuse_off(message: Any) -> None:
    if not message.data:
        raise BadMessageError("number_count", "it is never off")


GOOD = b"\x00\x01\x00\x00\x01"
ATTACHED = Attachment(1, 0, bytes(range(16))).encode()

BAD = {
    "no attachment": (GOOD, None, "no_attachment: the message has no attachment"),
    "truncated CDR": (GOOD[:-1], ATTACHED, "truncated: std_srvs/srv/SetBool_Request, 4 bytes"),
    "refused by the callback's check": (GOOD[:-1] + b"\0", ATTACHED, "number_count: it is never off"),
}


@pytest.mark.parametrize(("payload", "attached", "said"), BAD.values(), ids=BAD)
def test_a_bad_request_gets_an_error_reply_with_the_reason_and_is_counted_and_logged_once(
    sessions: TwoSessions,
    caplog: pytest.LogCaptureFixture,
    payload: bytes,
    attached: bytes | None,
    said: str,
) -> None:
    got: list[Received] = []
    serve(sessions, got.append, refuse_off)
    querier = sessions.network.transport("c3").request(client(sessions).key)
    replies: list[Reply | None] = []
    for _ in range(3):
        querier.get((payload,), attached, replies.append, SECOND_NS)
        sessions.settle()
    errors = [reply.error for reply in replies if reply is not None]
    assert len(errors) == 3
    assert all(error is not None and error.startswith(said) for error in errors)
    assert got == []
    assert sessions.there.rejections.counts() == {said.partition(":")[0]: 3}
    (record,) = caplog.records
    sender = f"publisher {bytes(range(16)).hex()}" if attached else "an unknown sender"
    assert f"from {sender} (" in record.getMessage()
    querier.get((GOOD,), ATTACHED, replies.append, SECOND_NS)
    sessions.settle()
    assert len(got) == 1, "a good request passes"


def test_a_request_of_another_type_is_never_heard(sessions: TwoSessions) -> None:
    got: list[Received] = []
    serve(sessions, got.append)
    answers: list[Any] = []
    trigger = types().service("std_srvs/srv/Trigger")
    other = sessions.here.node("client").client(trigger, "switch")
    other.call(trigger.request.cls(structure_needs_at_least_one_member=0), answers.append, SECOND_NS)
    sessions.settle()
    assert got == []
    assert [str(answer) for answer in answers] == ["no answer from service /switch"]
