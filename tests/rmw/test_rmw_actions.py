"""Actions between two sessions: goals, feedback, results, cancellation, status."""

from __future__ import annotations

from threading import Thread
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from two_sessions import TwoSessions, types

from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.rmw.action_client import ActionClient, ActionEvent
from reconros_zenoh.rmw.action_server import STATUS_QOS, ActionServer, GoalHandle, GoalStatus
from reconros_zenoh.ros.zero_message import zero_message

FIBONACCI = types().action("example_interfaces/action/Fibonacci")
LIMIT_S = 5
"""Of a wait that is over at once, unless the test fails."""


def numbers(*values: int) -> Any:
    return np.array(values, np.int32)


class Case:
    """A server of /fibonacci that accepts goals up to order 10, a client, and what each heard."""

    def __init__(self) -> None:
        self.sessions = TwoSessions()
        self.goals: list[GoalHandle] = []
        self.events: list[ActionEvent] = []
        self.statuses: list[list[int]] = []
        self.server = ActionServer(
            self.sessions.here.node("server"),
            FIBONACCI,
            "fibonacci",
            lambda g, _: self.goals.append(g),
            accept,
        )
        self.client_node = self.sessions.there.node("client")
        self.client = ActionClient(self.client_node, FIBONACCI, "fibonacci", self.events.append)
        self.client_node.subscription(
            FIBONACCI.status,
            "fibonacci/_action/status",
            lambda received: self.statuses.append([entry.status for entry in received.message.status_list]),
            STATUS_QOS,
        )
        assert not self.client.is_ready
        self.sessions.settle()
        assert self.client.is_ready

    def send(self, order: int = 3) -> bytes:
        goal_id = self.client.new_goal_id()
        self.client.send_goal(FIBONACCI.goal.cls(order=order), goal_id)
        self.sessions.settle()
        return goal_id

    def finish(self, goal: GoalHandle, *values: int) -> None:
        self.server.finish(goal, FIBONACCI.result.cls(sequence=numbers(*values)))
        self.sessions.settle()

    def kinds(self) -> list[str]:
        return [event.kind for event in self.events]


def accept(goal: Any) -> None:
    if goal.order > 10:
        raise BadMessageError("order", f"{goal.order} is more than 10")


def test_a_goal_from_beginning_to_end() -> None:
    case = Case()
    goal_id = case.send(4)
    (goal,) = case.goals
    assert (goal.goal_id, goal.goal.order, goal.status) == (goal_id, 4, GoalStatus.ACCEPTED)
    case.server.execute(goal)
    goal.feedback(FIBONACCI.feedback.cls(sequence=numbers(0, 1)))
    case.sessions.settle()
    case.finish(goal, 0, 1, 1, 2)
    assert case.kinds() == ["accepted", "feedback", "result"]
    assert {event.goal_id for event in case.events} == {goal_id}
    assert case.events[1].message.sequence.tolist() == [0, 1]
    assert case.events[2].message.sequence.tolist() == [0, 1, 1, 2]
    assert case.events[2].status is GoalStatus.SUCCEEDED
    assert case.statuses == [[1], [2], [4]]


def test_a_goal_that_is_refused_is_counted() -> None:
    case = Case()
    case.send(11)
    assert case.kinds() == ["rejected"]
    assert not case.goals
    assert case.sessions.here.rejections.counts() == {"order": 1}


@pytest.mark.parametrize(("order", "stamp"), [(3, (0, 1000)), (11, (0, 0))])
def test_the_answer_to_a_goal_says_when_it_was_accepted_if_it_was(order: int, stamp: tuple[int, int]) -> None:
    case = Case()
    answers: list[Any] = []
    request = zero_message(FIBONACCI.send_goal.request)
    request.goal.order = order
    case.client_node.client(FIBONACCI.send_goal, "fibonacci/_action/send_goal").call(
        request, answers.append, 10**9
    )
    case.sessions.settle()
    assert (answers[0].stamp.sec, answers[0].stamp.nanosec) == stamp


def test_a_goal_id_is_accepted_once() -> None:
    case = Case()
    goal_id = case.send()
    case.client.send_goal(FIBONACCI.goal.cls(order=1), goal_id)
    case.sessions.settle()
    assert case.kinds() == ["accepted", "rejected"]
    assert len(case.goals) == 1


@pytest.mark.parametrize("honours", [True, False])
def test_a_canceled_goal(honours: bool) -> None:
    case = Case()
    goal_id = case.send()
    (goal,) = case.goals
    assert not goal.is_cancel_requested
    case.client.cancel(goal_id)
    case.sessions.settle()
    assert goal.is_cancel_requested
    if honours:
        goal.canceled()
    case.finish(goal, 0)
    assert case.kinds() == ["accepted", "canceling", "result"]
    assert case.events[-1].status is (GoalStatus.CANCELED if honours else GoalStatus.SUCCEEDED)
    case.client.cancel(goal_id)
    case.sessions.settle()
    assert case.kinds()[-1] == "not canceling"


def test_a_goal_that_nobody_cancels_cannot_end_as_canceled() -> None:
    case = Case()
    case.send()
    (goal,) = case.goals
    case.server.execute(goal)
    with pytest.raises(UsageError, match="a goal whose `is_cancel_requested` is true"):
        goal.canceled()
    case.finish(goal, 0)
    assert case.events[-1].status is GoalStatus.SUCCEEDED


def cancel_code(case: Case, goal_id: bytes, stamp_ns: int = 0) -> tuple[int, int]:
    """The return code and the number of canceled goals of a raw request."""
    request = zero_message(FIBONACCI.cancel_goal.request)
    request.goal_info.goal_id.uuid[:] = list(goal_id)
    request.goal_info.stamp.sec, request.goal_info.stamp.nanosec = divmod(stamp_ns, 10**9)
    answers: list[Any] = []
    case.client_node.client(FIBONACCI.cancel_goal, "fibonacci/_action/cancel_goal").call(
        request, answers.append, 10**9
    )
    case.sessions.settle()
    return answers[0].return_code, len(answers[0].goals_canceling)


def test_who_is_meant_by_a_request_to_cancel() -> None:
    case = Case()
    ids = []
    for second in (1, 2, 3, 4):
        case.sessions.here_ns = second * 10**9
        ids.append(case.send())
    assert cancel_code(case, bytes(16), 2 * 10**9) == (0, 2)  # all that were accepted until then
    assert cancel_code(case, ids[3], 1) == (0, 1)  # that one, and all that are older
    assert cancel_code(case, ids[3]) == (3, 0)  # it is being canceled already
    assert [goal.is_cancel_requested for goal in case.goals] == [True, True, False, True]
    assert cancel_code(case, bytes(16)) == (0, 1)  # all, and only one is not being canceled yet
    assert cancel_code(case, bytes(16)) == (0, 0)
    assert cancel_code(case, bytes(15) + b"x") == (2, 0)
    case.finish(case.goals[0])
    assert cancel_code(case, ids[0]) == (3, 0)


def test_a_time_to_cancel_counts_to_the_nanosecond_and_from_the_start_of_the_clock() -> None:
    case = Case()
    ids = []
    for accepted_ns in (0, 2 * 10**9 + 5, 2 * 10**9 + 6):
        case.sessions.here_ns = accepted_ns
        ids.append(case.send())
    assert cancel_code(case, ids[2]) == (0, 1)  # no time is given: that one alone
    assert cancel_code(case, bytes(16), 2 * 10**9 + 4) == (0, 1)
    assert cancel_code(case, bytes(16), 2 * 10**9 + 5) == (0, 1)
    assert [goal.is_cancel_requested for goal in case.goals] == [True, True, True]


def test_an_aborted_goal_and_one_that_failed() -> None:
    case = Case()
    case.send()
    case.send()
    case.goals[0].abort()
    case.finish(case.goals[0], 1)
    case.server.fail(case.goals[1])
    case.sessions.settle()
    results = [event for event in case.events if event.kind == "result"]
    assert [event.status for event in results] == [GoalStatus.ABORTED] * 2
    assert [event.message.sequence.tolist() for event in results] == [[1], []]


def test_the_result_of_an_unknown_goal() -> None:
    case = Case()
    answers: list[Any] = []
    case.client_node.client(FIBONACCI.get_result, "fibonacci/_action/get_result").call(
        zero_message(FIBONACCI.get_result.request), answers.append, 10**9
    )
    case.sessions.settle()
    assert (answers[0].status, answers[0].result.sequence.tolist()) == (GoalStatus.UNKNOWN, [])


def test_a_result_of_a_wrong_type_leaves_the_goal_as_it_was() -> None:
    case = Case()
    case.send()
    with pytest.raises(UsageError, match="Fibonacci_Result is wanted, not 5"):
        case.server.finish(case.goals[0], 5)
    assert not case.goals[0].status.ended


def test_without_a_server_nobody_answers() -> None:
    sessions = TwoSessions()
    events: list[ActionEvent] = []
    client = ActionClient(sessions.there.node("client"), FIBONACCI, "fibonacci", events.append)
    goal_id = client.new_goal_id()
    client.send_goal(FIBONACCI.goal.cls(order=1), goal_id)
    client.cancel(goal_id)
    sessions.settle()
    assert [event.kind for event in events] == ["unanswered"] * 2


def test_a_goal_that_is_accepted_while_its_client_is_closed_ends(caplog: pytest.LogCaptureFixture) -> None:
    case = Case()
    goal_id = case.client.new_goal_id()
    case.client.send_goal(FIBONACCI.goal.cls(order=3), goal_id)
    (get_result,) = (end for end in case.client_node.endpoints if end.name.endswith("get_result"))
    get_result.close()
    case.sessions.settle()
    assert case.kinds() == ["accepted", "unanswered"]
    assert not case.client._mine
    assert not caplog.records


def test_feedback_on_the_goals_of_others_is_not_heard() -> None:
    case = Case()
    other: list[ActionEvent] = []
    ActionClient(case.sessions.there.node("other"), FIBONACCI, "fibonacci", other.append)
    case.send()
    case.goals[0].feedback(FIBONACCI.feedback.cls(sequence=numbers(1)))
    case.sessions.settle()
    assert case.kinds() == ["accepted", "feedback"]
    assert not other


def test_who_gets_a_result_may_wait_for_what_another_thread_does_with_the_server() -> None:
    case = Case()
    case.send()
    case.send()
    ended, other = case.goals
    threads: list[Thread] = []

    class Waiting:
        def respond_encoded(self, _: object) -> None:
            threads.append(Thread(target=case.server.execute, args=(other,), daemon=True))
            threads[0].start()
            threads[0].join(LIMIT_S)

    case.server._waiting[ended.goal_id].append(Waiting())  # type: ignore[arg-type] # it never fails
    case.finish(ended)
    assert not threads[0].is_alive()
    assert other.status is GoalStatus.EXECUTING


def test_old_results_are_forgotten() -> None:
    case = Case()
    for _ in range(120):
        case.send()
        case.finish(case.goals[-1])
    assert len(case.server._goals) == len(case.server._entries) == len(case.server._results) == 100


def test_a_goal_that_took_longer_than_a_hundred_others_keeps_its_result() -> None:
    case = Case()
    goal_id = case.send()
    for _ in range(100):
        case.send()
        case.finish(case.goals[-1])
    case.finish(case.goals[0], 1)
    assert goal_id in case.server._results
    assert case.statuses[-1].count(GoalStatus.SUCCEEDED) == 100


@settings(max_examples=40)
@given(
    st.lists(
        st.tuples(st.sampled_from(["send", "execute", "cancel", "finish"]), st.integers(0, 5)), max_size=25
    )
)
def test_every_goal_ends_once_however_things_interleave(steps: list[tuple[str, int]]) -> None:
    case = Case()
    ids: list[bytes] = []
    for step, number in steps:
        if step == "send":
            ids.append(case.send())
        elif number < len(case.goals):
            goal = case.goals[number]
            if step == "execute":
                case.server.execute(goal)
            elif step == "cancel":
                case.client.cancel(goal.goal_id)
            elif not goal.status.ended:
                case.finish(goal, number)
        case.sessions.settle()
    for goal in case.goals:
        if not goal.status.ended:
            case.finish(goal)
    results = [event.goal_id for event in case.events if event.kind == "result"]
    assert sorted(results) == sorted(ids)
    assert not case.server._waiting


def test_a_result_with_a_status_that_does_not_exist_is_no_answer() -> None:
    case = Case()
    goal_id = case.send()
    case.goals[0].outcome = 7  # type: ignore[assignment]
    case.finish(case.goals[0], 1)
    assert case.events[-1] == ActionEvent("unanswered", goal_id)


def test_so_many_wait_for_a_result_that_no_more_may() -> None:
    case = Case()
    goal_id = case.send()
    client = case.client_node.client(FIBONACCI.get_result, "fibonacci/_action/get_result")
    answers: list[Any] = []
    for _ in range(100):  # with the action client itself one too many
        request = zero_message(FIBONACCI.get_result.request)
        request.goal_id.uuid[:] = list(goal_id)
        client.call(request, answers.append, 10**9)
    case.sessions.settle()
    assert [str(answer) for answer in answers] == [
        "service /fibonacci/_action/get_result refused: 100 requests wait for the result of this goal already"
    ]
    case.finish(case.goals[0], 1)
    assert len(answers) == 100
    assert case.events[-1].kind == "result"
