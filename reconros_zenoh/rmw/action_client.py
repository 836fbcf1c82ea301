"""Action clients."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import xxhash

from reconros_zenoh.errors import BadMessageError, TransportError
from reconros_zenoh.rmw.action_server import GoalStatus
from reconros_zenoh.ros.qos import QosProfile
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.ends import ClientEnd, NodeEnds
    from reconros_zenoh.rmw.received import Received
    from reconros_zenoh.ros.types import ActionType, ServiceType

_ANSWER_NS = 10_000_000_000
_RESULT_NS = 3600 * 1_000_000_000


class ActionEvent(NamedTuple):
    """Something that happened to a goal of this client.

    `kind` is "accepted" or "rejected", then "feedback" with the feedback as `message`, at the end "result"
    with the result and the goal's final `status`. "canceling" and "not canceling" answer a request to cancel;
    "unanswered" means that the server did not answer at all, or with a status that does not exist.
    """

    kind: Literal["accepted", "rejected", "feedback", "result", "canceling", "not canceling", "unanswered"]
    goal_id: bytes
    message: Any = None
    status: GoalStatus = GoalStatus.UNKNOWN


class ActionClient:
    """Sends goals to one action; `on_event` hears what becomes of them, on the thread of whoever brings it.

    The result of an accepted goal is asked for at once, and waited for up to an hour. Goals are sent by one
    thread at a time.
    """

    def __init__(
        self, node: NodeEnds, action_type: ActionType, name: str, on_event: Callable[[ActionEvent], None]
    ) -> None:
        self._context = node.context
        self._type = action_type
        self._on_event = on_event
        self._mine: set[bytes] = set()
        hidden = f"{name}/_action"
        self._matched: dict[ServiceType, bool] = {}
        self._send_goal = self._client(node, action_type.send_goal, f"{hidden}/send_goal")
        self._cancel_goal = self._client(node, action_type.cancel_goal, f"{hidden}/cancel_goal")
        self._get_result = self._client(node, action_type.get_result, f"{hidden}/get_result")
        node.subscription(action_type.feedback_message, f"{hidden}/feedback", self._on_feedback, QosProfile())

    @property
    def is_ready(self) -> bool:
        """Whether a server with all of its services is there; goals that are sent before are not answered."""
        return all(self._matched.values())

    def new_goal_id(self) -> bytes:
        """Return the id of a new goal: 16 bytes that no other client has.

        Deviation: not random, because virtual time repeats itself; the session's id makes it unique.
        """
        unique = f"{self._context.transport.session_id} goal {self._context.next_id()}"
        return xxhash.xxh3_128_digest(unique.encode())

    def send_goal(self, goal: object, goal_id: bytes) -> None:
        """Send a goal; raise UsageError when it is not of the action's type."""
        request = zero_message(self._type.send_goal.request)
        request.goal_id.uuid[:] = list(goal_id)
        request.goal = goal
        if not self.is_ready:
            self._on_event(ActionEvent("unanswered", goal_id))
            return
        self._mine.add(goal_id)

        def on_response(response: Any) -> None:
            if _missing(response):
                self._end(ActionEvent("unanswered", goal_id))
            elif response.accepted:
                self._on_event(ActionEvent("accepted", goal_id, status=GoalStatus.ACCEPTED))
                self._ask_result(goal_id)
            else:
                self._end(ActionEvent("rejected", goal_id))

        self._send_goal.call(request, on_response, _ANSWER_NS)

    def cancel(self, goal_id: bytes) -> None:
        """Ask for the goal to end early; its result says whether it did."""
        request = zero_message(self._type.cancel_goal.request)
        request.goal_info.goal_id.uuid[:] = list(goal_id)

        def on_response(response: Any) -> None:
            if _missing(response):
                self._on_event(ActionEvent("unanswered", goal_id))
            else:
                canceling = any(bytes(info.goal_id.uuid) == goal_id for info in response.goals_canceling)
                self._on_event(ActionEvent("canceling" if canceling else "not canceling", goal_id))

        self._cancel_goal.call(request, on_response, _ANSWER_NS)

    def _client(self, node: NodeEnds, service_type: ServiceType, name: str) -> ClientEnd:
        self._matched[service_type] = False

        def on_matching(matching: bool) -> None:
            self._matched[service_type] = matching

        return node.client(service_type, name, on_matching)

    def _ask_result(self, goal_id: bytes) -> None:
        request = zero_message(self._type.get_result.request)
        request.goal_id.uuid[:] = list(goal_id)

        def on_response(response: Any) -> None:
            if _missing(response) or response.status not in set(GoalStatus):
                self._end(ActionEvent("unanswered", goal_id))
            else:
                self._end(ActionEvent("result", goal_id, response.result, GoalStatus(response.status)))

        try:
            self._get_result.call(request, on_response, _RESULT_NS)
        except TransportError:  # the session is being closed
            self._end(ActionEvent("unanswered", goal_id))

    def _end(self, event: ActionEvent) -> None:
        self._mine.discard(event.goal_id)
        self._on_event(event)

    def _on_feedback(self, received: Received) -> None:
        goal_id = bytes(received.message.goal_id.uuid)
        if goal_id in self._mine:
            self._on_event(ActionEvent("feedback", goal_id, received.message.feedback))


def _missing(response: object) -> bool:
    return isinstance(response, BadMessageError | TransportError)
