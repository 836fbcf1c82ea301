"""Actions on a board: goals start a callback of the server, what becomes of them one of the client."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import Tickets, desktop, small_board, small_profile, types

from reconros_zenoh.board.actions import ActionClientSource, ActionSource
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.errors import BadMessageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.rmw.action_client import ActionClient
from reconros_zenoh.rmw.action_server import ActionServer, GoalStatus

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.board.software import SoftwareCallback, SoftwareContext
    from reconros_zenoh.rmw.action_client import ActionEvent
    from reconros_zenoh.rmw.action_server import GoalHandle

FIBONACCI = types().action("example_interfaces/action/Fibonacci")
PROFILE = small_profile({"serve": (100_000, 500), "ask": (10, 10), "hear": (10, 10)}, link_ns=1000, osif_ns=7)
SRV, SUB, CLT = CallbackKind.SRV, CallbackKind.SUB, CallbackKind.CLT


def fibonacci(order: int) -> Any:
    numbers = [0, 1]
    while len(numbers) < order:
        numbers.append(numbers[-1] + numbers[-2])
    return np.array(numbers[:order], np.int32)


class Serving:
    """A board that serves /fibonacci in slot 0 or in software, and a client on the desktop."""

    def __init__(self, callback: Any, *, hardware: bool, check: Any = None) -> None:
        self.board = small_board(PROFILE, 1)
        node = self.board.context.node("server")
        self.source = ActionSource(self.board, node, FIBONACCI, "fibonacci")
        self.executor = Executor(self.board, 1, 1)
        if hardware:
            self.executor.add_hw_callback("serve", [0], SRV, self.source, callback(self), check)
        else:
            self.executor.add_sw_callback("serve", SRV, self.source, callback(self), check)
        self.executor.spin()
        self.events: list[ActionEvent] = []
        self.client = ActionClient(
            desktop(self.board).node("client"), FIBONACCI, "fibonacci", self.events.append
        )
        self.run(1)

    def send(self, order: int) -> bytes:
        goal_id = self.client.new_goal_id()
        self.client.send_goal(FIBONACCI.goal.cls(order=order), goal_id)
        return goal_id

    def run(self, for_ns: int = 10**9) -> list[str]:
        self.board.environment.run(until=self.board.environment.now + for_ns)
        return [event.kind for event in self.events]


def in_software(case: Serving) -> Any:
    def callback(goal: GoalHandle, _: SoftwareContext) -> Any:
        goal.feedback(case.source.feedback(sequence=fibonacci(2)))
        return case.source.result(sequence=fibonacci(goal.goal.order))

    return callback


def in_hardware(case: Serving) -> Any:
    def callback(thread: HardwareThread) -> Steps:
        goal = yield from thread.get_init_data()
        sequence = yield from thread.compute(fibonacci, goal.goal.order)
        yield from thread.feedback(goal, case.source.feedback(sequence=sequence[:2]))
        for _ in range(3):
            if (yield from thread.is_cancel_requested(goal)):
                goal.canceled()
                break
            yield from thread.compute_cycles(5000)
        return case.source.result(sequence=sequence)

    return callback


def test_a_goal_is_executing_once_its_callback_has_begun() -> None:
    states: list[GoalStatus] = []

    def notes(case: Serving) -> Any:
        def callback(goal: GoalHandle, _: SoftwareContext) -> Any:
            states.append(goal.status)
            return case.source.result(sequence=fibonacci(1))

        return callback

    case = Serving(notes, hardware=False)
    case.send(1)
    case.run()
    assert states == [GoalStatus.EXECUTING]


@pytest.mark.parametrize(("callback", "hardware"), [(in_software, False), (in_hardware, True)])
def test_a_goal_is_served(callback: Any, hardware: bool) -> None:
    case = Serving(callback, hardware=hardware)
    case.send(5)
    assert sorted(case.run()) == ["accepted", "feedback", "result"]
    result = case.events[-1]
    assert result.message.sequence.tolist() == [0, 1, 1, 2, 3]
    assert result.status is GoalStatus.SUCCEEDED
    statistics = case.executor.statistics()["serve"]
    assert (statistics["kind"], statistics["calls"], statistics["failed"]) == ("SRV", 1, 0)
    assert case.board.spans.mean_ms()["serve"]["transport"] == pytest.approx(0.001)


def test_a_goal_is_canceled_while_its_slot_works() -> None:
    case = Serving(in_hardware, hardware=True)
    goal_id = case.send(5)
    case.run(8000)
    case.client.cancel(goal_id)
    assert sorted(case.run()) == ["accepted", "canceling", "feedback", "result"]
    assert case.events[-1].status is GoalStatus.CANCELED


def test_a_callback_that_fails_aborts_its_goal(caplog: pytest.LogCaptureFixture) -> None:
    def fails(_: Serving) -> Any:
        def callback(goal: GoalHandle, _: SoftwareContext) -> Any:
            return 1 / (goal.goal.order - 5)

        return callback

    case = Serving(fails, hardware=False)
    case.send(5)  # raises
    case.send(6)  # returns what is no result
    case.run()
    assert [event.status for event in case.events if event.kind == "result"] == [GoalStatus.ABORTED] * 2
    assert case.executor.failures == {"serve": 2}
    assert "Fibonacci_Result is wanted, not 1.0." in str(caplog.records[-1].exc_info)


def test_feedback_of_another_type_fails_the_callback(caplog: pytest.LogCaptureFixture) -> None:
    def answers(_: Serving) -> Any:
        def callback(goal: GoalHandle, _: SoftwareContext) -> Any:
            goal.feedback(goal.goal)

        return callback

    case = Serving(answers, hardware=False)
    case.send(5)
    assert "feedback" not in case.run()
    assert "Fibonacci_Feedback is wanted, not one of type" in str(caplog.records[-1].exc_info)


def test_goals_that_are_refused_are_logged_once_for_each_client(caplog: pytest.LogCaptureFixture) -> None:
    def check(_: Any) -> None:
        raise BadMessageError("order", "too many")

    case = Serving(in_software, hardware=False, check=check)
    other = ActionClient(desktop(case.board).node("other"), FIBONACCI, "fibonacci", case.events.append)
    case.run(1)
    for _ in range(2):
        case.send(1)
        other.send_goal(FIBONACCI.goal.cls(order=1), other.new_goal_id())
    assert case.run() == ["rejected"] * 4
    assert case.board.context.rejections.counts() == {"order": 4}
    senders = [client._send_goal.gid.hex() for client in (case.client, other)]  # type: ignore[attr-defined]
    assert sorted(text.split(" (")[0] for text in caplog.messages) == sorted(
        f"refused a message on fibonacci from publisher {sender}" for sender in senders
    )


def test_goals_that_are_refused() -> None:
    def check(goal: Any) -> None:
        if goal.order > 10:
            raise BadMessageError("order", "too many")

    case = Serving(in_software, hardware=False, check=check)
    case.send(11)
    assert case.run() == ["rejected"]
    for _ in range(12):
        case.send(1)
        case.run(200)
    kinds = case.run()
    # One is being worked on when the others come, ten wait.
    assert (kinds.count("accepted"), kinds.count("rejected"), kinds.count("result")) == (11, 2, 11)
    assert case.source.dropped == 1


class Asking:
    """A board with an action client, and a server on the desktop that refuses odd orders."""

    def __init__(self, *, hardware: bool, profile: Profile = PROFILE) -> None:
        self.board = small_board(profile, 2)
        node = self.board.context.node("client")
        self.client = ActionClientSource(self.board, node, FIBONACCI, "fibonacci")
        self.executor, self.tickets = Executor(self.board, 1, 2), Tickets(self.board)
        self.sent: list[bytes] = []
        self.handles: list[GoalHandle] = []
        self.events: list[ActionEvent] = []
        if hardware:
            self.executor.add_hw_callback("ask", [0], SUB, self.tickets, self.ask_in_hardware)
            self.executor.add_hw_callback("hear", [1], CLT, self.client, self.hear_in_hardware)
        else:
            self.executor.add_sw_callback("ask", SUB, self.tickets, self.ask)
            self.executor.add_sw_callback("hear", CLT, self.client, self.hear)
        self.executor.spin()
        self.server = ActionServer(
            desktop(self.board).node("server"), FIBONACCI, "fibonacci", self.serve, self.accept
        )
        self.board.environment.run(until=1)

    def ask(self, order: int, context: SoftwareContext) -> None:
        if order < 0:
            context.cancel_goal(self.client, self.sent[-1])
        else:
            self.sent.append(context.send_goal(self.client, self.client.goal(order=order)))

    def hear(self, event: ActionEvent, _: SoftwareContext) -> None:
        self.events.append(event)

    def ask_in_hardware(self, thread: HardwareThread) -> Steps:
        order = yield from thread.get_init_data()
        if order < 0:
            yield from thread.cancel_goal(self.client, self.sent[-1])
        else:
            self.sent.append((yield from thread.send_goal(self.client, self.client.goal(order=order))))

    def hear_in_hardware(self, thread: HardwareThread) -> Steps:
        self.events.append((yield from thread.get_init_data()))

    def failures_of(self, ask: SoftwareCallback) -> int:
        """How often a callback of an executor of its own failed, which is called once."""
        executor, tickets = Executor(self.board, 1, 0), Tickets(self.board)
        executor.add_sw_callback("ask", SUB, tickets, ask)
        executor.spin()
        tickets.put(None)
        self.board.environment.run(until=10**6)
        return executor.failures["ask"]

    def accept(self, goal: Any) -> None:
        if goal.order % 2:
            raise BadMessageError("order", "odd")

    def serve(self, handle: GoalHandle, _: Any) -> None:
        self.handles.append(handle)
        for place in range(handle.goal.order):
            handle.feedback(FIBONACCI.feedback.cls(sequence=fibonacci(place)))
        if handle.goal.order == 2:
            self.server.finish(handle, FIBONACCI.result.cls(sequence=fibonacci(2)))

    def run(self, *orders: int) -> list[str]:
        for order in orders:
            self.tickets.put(order)
            self.board.environment.run(until=self.board.environment.now + 10**6)
        return [event.kind for event in self.events]


@pytest.mark.parametrize("hardware", [False, True])
def test_what_becomes_of_goals_starts_the_clients_callback(hardware: bool) -> None:
    case = Asking(hardware=hardware)
    kinds = case.run(1, 2)
    assert kinds[0] == "rejected"
    assert sorted(kinds[1:]) == ["accepted", "feedback", "feedback", "result"]
    assert [event.goal_id for event in case.events] == [case.sent[0]] + [case.sent[1]] * 4
    assert case.events[-1].message.sequence.tolist() == [0, 1]


@pytest.mark.parametrize("hardware", [False, True])
def test_a_client_cancels_its_goal(hardware: bool) -> None:
    case = Asking(hardware=hardware)
    assert case.run(0, -1) == ["accepted", "canceling"]


def test_results_come_in_the_order_in_which_they_were_sent_also_when_a_fragment_is_lost() -> None:
    profile = small_profile(
        {"ask": (10, 10), "hear": (10, 10)}, large_from=200, loss_probability=1, heartbeat_ns=10**6
    )
    case = Asking(hardware=False, profile=profile)
    case.run(0, 4)
    for handle, length in zip(case.handles, (100, 1), strict=True):
        case.server.finish(handle, FIBONACCI.result.cls(sequence=np.zeros(length, np.int32)))
    case.board.environment.run(until=10**9)
    assert [event.goal_id for event in case.events if event.kind == "result"] == case.sent


def test_goals_that_are_pushed_out_before_they_are_sent_are_told_as_unanswered(
    caplog: pytest.LogCaptureFixture,
) -> None:
    profile = small_profile({"ask": (10, 10), "hear": (10, 10)}, dds_message_ns=1000)
    case = Asking(hardware=False, profile=profile)
    for _ in range(15):
        case.tickets.put(0)
    case.board.environment.run(until=10**6)
    kinds = {event.goal_id: event.kind for event in case.events}
    assert len(case.handles) == 11
    assert [kinds[goal_id] for goal_id in case.sent] == ["accepted"] + ["unanswered"] * 4 + ["accepted"] * 10
    assert "a call of service /fibonacci/_action/send_goal has no answer: newer calls" in caplog.text


def test_old_feedback_makes_room_and_nothing_else_does() -> None:
    case = Asking(hardware=False)
    case.executor.select = lambda *_: None  # type: ignore[method-assign] # nobody takes anything
    goal_id = case.client.new_goal_id()
    case.client.send_goal(case.client.goal(order=0), goal_id)
    case.run(0)
    for place in range(14):
        case.handles[0].feedback(FIBONACCI.feedback.cls(sequence=fibonacci(place)))
        case.board.environment.run(until=case.board.environment.now + 10_000)
    waiting = [event.message.kind for event in case.client._queue]
    assert (waiting.count("feedback"), waiting.count("accepted")) == (10, 1)
    assert case.client.dropped == 4
    last = [event.message.message for event in case.client._queue if event.message.kind == "feedback"]
    assert len(last[-1].sequence) == 13


def test_a_goal_is_taken_as_it_is_when_it_is_sent() -> None:
    case = Asking(hardware=False)

    def ask(_: object, context: SoftwareContext) -> None:
        goal = case.client.goal(order=0)
        context.send_goal(case.client, goal)
        goal.order = 1

    executor, tickets = Executor(case.board, 1, 0), Tickets(case.board)
    executor.add_sw_callback("ask", SUB, tickets, ask)
    executor.spin()
    tickets.put(None)
    case.board.environment.run(until=10**6)
    assert [handle.goal.order for handle in case.handles] == [0]


@pytest.mark.parametrize("goal_id", [b"", b"too short", bytes(17), "a" * 16, 16, None])
def test_with_what_is_no_goal_id_nothing_of_the_call_is_sent(
    goal_id: Any, caplog: pytest.LogCaptureFixture
) -> None:
    case = Asking(hardware=False)

    def ask(_: object, context: SoftwareContext) -> None:
        context.send_goal(case.client, case.client.goal(order=0))
        context.cancel_goal(case.client, goal_id)

    assert case.failures_of(ask) == 1
    assert f"{goal_id!r} is no goal id. Give the 16 bytes that `send_goal` has returned." in caplog.text
    assert not case.handles


def test_in_hardware_what_is_no_goal_id_fails_the_callback(caplog: pytest.LogCaptureFixture) -> None:
    case = Asking(hardware=True)
    case.sent.append(b"too short")
    assert case.run(-1) == []
    assert case.executor.failures == {"ask": 1}
    assert "b'too short' is no goal id" in caplog.text


def test_with_a_goal_of_a_wrong_type_nothing_of_the_call_is_sent(caplog: pytest.LogCaptureFixture) -> None:
    case = Asking(hardware=False)

    def ask(_: object, context: SoftwareContext) -> None:
        context.send_goal(case.client, case.client.goal(order=0))
        context.send_goal(case.client, case.client.goal(order="many"))

    assert case.failures_of(ask) == 1
    assert "Goal cannot be serialised" in caplog.text
    assert not case.handles
