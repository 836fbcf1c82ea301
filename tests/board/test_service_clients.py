"""Service clients on a board: called by one callback, answered to another."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from small_board import Tickets, desktop, small_board, small_profile, types

from reconros_zenoh.board.clients import ClientSource
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.errors import BadMessageError, TransportError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.ros.attachment import Attachment

if TYPE_CHECKING:
    from collections.abc import Callable

    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

SET_BOOL = types().service("std_srvs/srv/SetBool")
CALLBACKS = {"ask": (100, 100), "hear": (50, 50)}
ANSWER_NS = 10**10


class Asking:
    """A board whose callback `ask` calls the service and whose callback `hear` gets the responses."""

    def __init__(
        self,
        *,
        hardware: bool = False,
        serve: bool = True,
        check: Any = None,
        **options: Any,
    ) -> None:
        self.board = small_board(small_profile(CALLBACKS, link_ns=1000, osif_ns=7, **options), 2)
        self.client = ClientSource(self.board, self.board.context.node("client"), SET_BOOL, "set")
        self.executor = Executor(self.board, 1, 2)
        self.tickets = Tickets(self.board)
        self.heard: list[tuple[int, Any]] = []
        self.called: dict[int, Any] = {}
        self.answered: list[int | None] = []
        if hardware:
            self.executor.add_hw_callback("ask", [0], CallbackKind.SUB, self.tickets, self.ask_in_hardware)
            self.executor.add_hw_callback(
                "hear", [1], CallbackKind.CLT, self.client, self.hear_in_hardware, check
            )
        else:
            self.executor.add_sw_callback("ask", CallbackKind.SUB, self.tickets, self.ask)
            self.executor.add_sw_callback("hear", CallbackKind.CLT, self.client, self.hear, check)
        self.executor.spin()
        self.requests: list[Any] = []
        if serve:
            desktop(self.board).node("server").service(SET_BOOL, "set", self.serve)

    def ask(self, ticket: Any, context: SoftwareContext) -> None:
        self.called[context.call(self.client, self.client.request(data=bool(ticket)))] = ticket

    def hear(self, response: Any, context: SoftwareContext) -> None:
        self.heard.append((context.now_ns, response))
        self.answered.append(context.sequence_number)

    def ask_in_hardware(self, thread: HardwareThread) -> Steps:
        ticket = yield from thread.get_init_data()
        number = yield from thread.call(self.client, self.client.request(data=bool(ticket)))
        self.called[number] = ticket

    def hear_in_hardware(self, thread: HardwareThread) -> Steps:
        response = yield from thread.get_init_data()
        self.heard.append((self.board.environment.now, response))
        self.answered.append(thread.sequence_number)

    def serve(self, received: Any) -> None:
        self.requests.append(received.message.data)
        answer = SET_BOOL.response.cls(success=received.message.data, message="")
        received.responder.respond_encoded(SET_BOOL.response.encode(answer))

    def run(self, *tickets: Any) -> None:
        for ticket in tickets:
            self.tickets.put(ticket)
        self.board.environment.run(until=2 * ANSWER_NS)


@pytest.mark.parametrize("hardware", [False, True])
def test_each_response_starts_the_clients_callback(hardware: bool) -> None:
    case = Asking(hardware=hardware)
    case.run(1, 0)
    assert case.requests == [True, False]
    assert [response.success for _, response in case.heard] == [True, False]
    statistics = case.executor.statistics()["hear"]
    assert (statistics["kind"], statistics["calls"], statistics["failed"]) == ("CLT", 2, 0)


def test_request_and_response_go_over_the_link_and_through_the_stack() -> None:
    case = Asking()
    case.run(1)
    # 100 ns of the caller, 1000 ns each way; the other callback's function runs when its 50 ns begin.
    assert case.heard[0][0] == 100 + 2 * 1000


@pytest.mark.parametrize("hardware", [False, True])
def test_a_call_without_an_answer_is_told_as_none(hardware: bool, caplog: pytest.LogCaptureFixture) -> None:
    case = Asking(hardware=hardware, serve=False)
    case.run(1)
    assert [response for _, response in case.heard] == [None]
    assert case.client.unanswered == 1
    assert "a call of service /set has no answer: no answer from service /set" in caplog.text


def test_that_nobody_answers_is_logged_once_until_somebody_does(caplog: pytest.LogCaptureFixture) -> None:
    case = Asking(serve=False)
    node = desktop(case.board).node("server")
    node.service(
        SET_BOOL,
        "set",
        lambda received: (
            case.serve(received) if received.message.data else received.responder.fail("no time")
        ),
    )
    for ticket in (0, 0, 0, 1, 0, 0):
        case.tickets.put(ticket)
        case.board.environment.run(until=case.board.environment.now + 10_000)
    assert case.client.unanswered == 5
    text = "a call of service /set has no answer: service /set refused: no time"
    assert caplog.messages == [f"{text}; until one has, this is not reported again"] * 2


def test_calls_that_are_pushed_out_before_they_are_sent_are_counted_and_told_as_none(
    caplog: pytest.LogCaptureFixture,
) -> None:
    case = Asking(dds_message_ns=1_000_000)
    case.run(*range(15))
    # One goes through the stack, ten wait, each further one pushes the oldest out.
    assert len(case.requests) == 11
    unsent = [number for number, (_, response) in zip(case.answered, case.heard, strict=True) if not response]
    assert unsent == [2, 3, 4, 5]
    assert sorted(number for number in case.answered if number) == sorted(case.called) == list(range(1, 16))
    assert case.executor.statistics()["hear"]["dropped"] == case.client.unanswered == 4
    assert "a call of service /set has no answer: newer calls pushed it out before it was sent" in caplog.text


def test_every_call_ends_however_slow_its_callback_is() -> None:
    class Slow(Asking):
        def hear_in_hardware(self, thread: HardwareThread) -> Steps:
            yield self.board.environment.timeout(ANSWER_NS // 100)
            yield from super().hear_in_hardware(thread)

    case = Slow(hardware=True)
    case.tickets.put_at(*range(0, 15 * 5000, 5000))
    case.run()
    assert len(case.requests) == 15
    assert case.answered == list(range(1, 16))
    assert case.executor.statistics()["hear"]["dropped"] == 0


def test_a_call_that_cannot_be_sent_is_told_as_none(caplog: pytest.LogCaptureFixture) -> None:
    case = Asking()

    def fail(*_: object, **__: object) -> None:
        raise TransportError("the session is closed")

    case.client._client.call_encoded = fail  # type: ignore[method-assign]
    case.run(1)
    assert [response for _, response in case.heard] == [None]
    assert "the session is closed" in caplog.text


@pytest.mark.parametrize("when", ["never", "before", "after"])
def test_a_call_that_cannot_be_sent_is_told_once(when: str) -> None:
    case = Asking()

    def fail(_: object, __: object, on_reply: Callable[[None], None], ___: int) -> None:
        if when == "before":
            on_reply(None)
        if when == "after":
            case.board.environment.call_later(1000, on_reply, None)
        raise TransportError("the session is closed")

    case.client._client._querier = SimpleNamespace(get=fail)  # type: ignore[assignment]
    case.run(1)
    assert [response for _, response in case.heard] == [None]


def test_a_server_that_says_nothing_is_given_up_in_time(caplog: pytest.LogCaptureFixture) -> None:
    case = Asking(serve=False)
    held: list[Any] = []
    desktop(case.board).node("server").service(SET_BOOL, "set", held.append)
    case.run(1)
    assert [response for _, response in case.heard] == [None]
    assert case.heard[0][0] == 100 + 1000 + ANSWER_NS


def test_a_refused_call(caplog: pytest.LogCaptureFixture) -> None:
    case = Asking(serve=False)
    desktop(case.board).node("server").service(
        SET_BOOL, "set", lambda received: received.responder.fail("no time")
    )
    case.run(1)
    assert [response for _, response in case.heard] == [None]
    assert "service /set refused: no time" in caplog.text


def test_a_response_that_the_callback_cannot_use(caplog: pytest.LogCaptureFixture) -> None:
    def check(response: Any) -> None:
        if not response.success:
            raise BadMessageError("success", "it says no")

    case = Asking(check=check)
    case.run(0, 1)
    assert [getattr(response, "success", None) for _, response in case.heard] == [None, True]
    assert case.board.context.rejections.counts() == {"success": 1}


@pytest.mark.parametrize("hardware", [False, True])
def test_a_callback_can_tell_which_call_a_response_belongs_to(
    hardware: bool, caplog: pytest.LogCaptureFixture
) -> None:
    case = Asking(hardware=hardware, serve=False)
    held: list[Any] = []
    desktop(case.board).node("server").service(SET_BOOL, "set", held.append)
    for ticket in (1, 2, 3):
        case.tickets.put(ticket)
    case.board.environment.run(until=ANSWER_NS // 2)
    assert [case.called[number] for number in (1, 2, 3)] == [1, 2, 3]
    # The last call is answered first, the second is refused, the first not answered at all.
    answer = SET_BOOL.response.encode(SET_BOOL.response.cls(success=True, message=""))
    held[2].responder.respond_encoded(answer)
    case.board.environment.run(until=ANSWER_NS // 2 + 10_000)
    held[1].responder.fail("no time")
    case.run()
    assert [case.called[number] for number in case.answered if number] == [3, 2, 1]
    assert [response is None for _, response in case.heard] == [False, True, True]


def test_calls_are_numbered_on_the_wire_as_their_callers_know_them() -> None:
    case = Asking(serve=False)
    seen: list[int] = []

    def serve(request: Any) -> None:
        seen.append(Attachment.decode(request.attachment).sequence_number)

    server = desktop(case.board)
    server.transport.serve(case.client._client.key, serve)
    server.node("server").service(SET_BOOL, "set", lambda _: None)
    case.run(1, 2)
    assert seen == list(case.called) == [1, 2]


def test_what_is_no_response_has_no_sequence_number() -> None:
    case = Asking()
    numbers: list[int | None] = []
    executor, tickets = Executor(case.board, 1, 0), Tickets(case.board)
    executor.add_sw_callback(
        "ask", CallbackKind.SUB, tickets, lambda _, context: numbers.append(context.sequence_number)
    )
    executor.spin()
    tickets.put(1)
    case.run()
    assert numbers == [None]


def test_a_request_of_a_wrong_type_fails_the_caller(caplog: pytest.LogCaptureFixture) -> None:
    case = Asking()
    case.ask = lambda _, context: context.call(case.client, 5)  # type: ignore[method-assign]
    executor, tickets = Executor(case.board, 1, 0), Tickets(case.board)
    executor.add_sw_callback("ask", CallbackKind.SUB, tickets, case.ask)
    executor.spin()
    tickets.put(1)
    case.run()
    assert executor.failures == {"ask": 1}
    assert not case.requests
