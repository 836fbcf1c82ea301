"""Action servers: goals, feedback, results and cancellation, as rcl_action has them on the wire."""

from __future__ import annotations

import threading
from collections import OrderedDict
from enum import IntEnum
from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.ros.qos import Durability, QosProfile
from reconros_zenoh.ros.stamp import set_stamp, stamp_ns
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.rmw.ends import NodeEnds
    from reconros_zenoh.rmw.received import Received, Responder
    from reconros_zenoh.ros.types import ActionType, MessageType

STATUS_QOS = QosProfile(durability=Durability.TRANSIENT_LOCAL, depth=1)
"""rcl_action_qos_profile_status_default."""

_ENDED_KEPT = 100
_MOST_WAITING = 100
_NONE, _REJECTED, _UNKNOWN_GOAL, _TERMINATED = range(4)  # return codes of action_msgs/srv/CancelGoal


class GoalStatus(IntEnum):
    """The state of a goal; the values are those of action_msgs/msg/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def ended(self) -> bool:
        """Whether nothing more happens to the goal."""
        return self >= GoalStatus.SUCCEEDED

    @property
    def cancelable(self) -> bool:
        """Whether a request to cancel the goal changes anything, as in the state machine of rcl_action."""
        return self in {GoalStatus.ACCEPTED, GoalStatus.EXECUTING}


class GoalHandle:
    """An accepted goal; its methods may be called from any thread.

    `goal` is the message. The goal ends when its server is told the result with `ActionServer.finish`: as
    succeeded, unless `canceled` or `abort` was called before.
    """

    def __init__(self, server: ActionServer, goal_id: bytes, goal: object, stamp_ns: int) -> None:
        self.goal_id = goal_id
        self.goal: Any = goal
        self.status = GoalStatus.ACCEPTED
        self.stamp_ns = stamp_ns
        self.outcome = GoalStatus.SUCCEEDED
        self._server = server

    @property
    def is_cancel_requested(self) -> bool:
        """Whether a client wants the goal to end early."""
        return self.status is GoalStatus.CANCELING

    def feedback(self, feedback: object) -> None:
        """Publish feedback on the goal."""
        self._server.publish_feedback(self, feedback)

    def canceled(self) -> None:
        """Say that the result is that of a goal that was canceled.

        Raises UsageError when no client wants that: rcl_action has no such transition.
        """
        if not self.is_cancel_requested:
            raise UsageError("canceled() is for a goal whose `is_cancel_requested` is true. Call abort().")
        self.outcome = GoalStatus.CANCELED

    def abort(self) -> None:
        """Say that the result is that of a goal that was not reached."""
        self.outcome = GoalStatus.ABORTED


class ActionServer:
    """Serves one action: `on_goal` gets each accepted goal and the request that it came with.

    `accept` tells whether a goal is accepted; it raises BadMessageError with the reason of a refusal, which
    is counted and logged by the context. The last 100 goals that have ended keep their results. Deviation:
    rcl keeps them for a time instead; a number bounds the memory. Everything may be called from any thread.
    """

    def __init__(
        self,
        node: NodeEnds,
        action_type: ActionType,
        name: str,
        on_goal: Callable[[GoalHandle, Any], None],
        accept: Callable[[Any], None],
    ) -> None:
        self._context = node.context
        self._name = name
        self._type = action_type
        self._on_goal = on_goal
        self._accept = accept
        self._lock = threading.RLock()
        self._goals: OrderedDict[bytes, GoalHandle] = OrderedDict()
        self._entries: dict[bytes, Any] = {}  # of each goal in the status message
        self._results: dict[bytes, Any] = {}
        self._waiting: dict[bytes, list[Responder]] = {}
        hidden = f"{name}/_action"
        self._feedback = node.publisher(action_type.feedback_message, f"{hidden}/feedback", QosProfile())
        self._status = node.publisher(action_type.status, f"{hidden}/status", STATUS_QOS)
        node.service(action_type.send_goal, f"{hidden}/send_goal", self._on_send_goal)
        node.service(action_type.cancel_goal, f"{hidden}/cancel_goal", self._on_cancel_goal)
        node.service(action_type.get_result, f"{hidden}/get_result", self._on_get_result)

    def execute(self, handle: GoalHandle) -> None:
        """Note that work on the goal has begun."""
        with self._lock:
            if handle.status is GoalStatus.ACCEPTED:
                handle.status = GoalStatus.EXECUTING
                self._publish_status()

    def finish(self, handle: GoalHandle, result: object) -> None:
        """End the goal with its outcome, and send the result to everyone who asked for it.

        Raises UsageError when the result is not of the action's type.
        """
        self._type.result.check(result)
        response = zero_message(self._type.get_result.response)
        response.status, response.result = int(handle.outcome), result
        parts = self._type.get_result.response.encode(response)
        with self._lock:
            handle.status = handle.outcome
            self._results[handle.goal_id] = parts
            self._forget_old()
            waiting = self._waiting.pop(handle.goal_id, ())
        # Not with the lock held: who gets the result may be in this session and send the next goal.
        for responder in waiting:
            responder.respond_encoded(parts)
        self._publish_status()

    def fail(self, handle: GoalHandle) -> None:
        """End the goal as aborted, with a result of zeros."""
        handle.abort()
        self.finish(handle, zero_message(self._type.result))

    def publish_feedback(self, handle: GoalHandle, feedback: object) -> None:
        """Publish feedback on a goal; raise UsageError when it is not of the action's type."""
        self._type.feedback.check(feedback)
        message = zero_message(self._type.feedback_message)
        message.goal_id.uuid[:] = list(handle.goal_id)
        message.feedback = feedback
        self._feedback.publish(message)

    def _on_send_goal(self, received: Received) -> None:
        request, responder = received.message, received.responder
        assert responder is not None
        goal_id = bytes(request.goal_id.uuid)
        response = zero_message(self._type.send_goal.response)
        handle = GoalHandle(self, goal_id, request.goal, self._context.clock_ns())
        with self._lock:
            response.accepted = goal_id not in self._goals and self._is_accepted(
                request.goal, received.publisher
            )
            if response.accepted:
                set_stamp(response.stamp, handle.stamp_ns)
                self._goals[goal_id] = handle
                self._entries[goal_id] = self._entry(handle)
        responder.respond_encoded(self._type.send_goal.response.encode(response))
        if response.accepted:
            self._publish_status()
            self._on_goal(handle, received)

    def _is_accepted(self, goal: object, sender: bytes) -> bool:
        try:
            self._accept(goal)
        except BadMessageError as error:
            self._context.rejections.add(self._name, sender, error)
            return False
        return True

    def _on_cancel_goal(self, received: Received) -> None:
        info, responder = received.message.goal_info, received.responder
        assert responder is not None
        goal_id = bytes(info.goal_id.uuid)
        until_ns = stamp_ns(info.stamp)
        response = zero_message(self._type.cancel_goal.response)
        with self._lock:
            meant = [handle for handle in self._goals.values() if _is_meant(handle, goal_id, until_ns)]
            going = [handle for handle in meant if handle.status.cancelable]
            for handle in going:
                handle.status = GoalStatus.CANCELING
            response.goals_canceling = [
                _goal_info(self._type.cancel_goal.response, handle) for handle in going
            ]
            if not going:
                one = any(goal_id) and not until_ns
                response.return_code = (_TERMINATED if meant else _UNKNOWN_GOAL) if one else _NONE
            else:
                self._publish_status()
        responder.respond_encoded(self._type.cancel_goal.response.encode(response))

    def _on_get_result(self, received: Received) -> None:
        responder = received.responder
        assert responder is not None
        goal_id = bytes(received.message.goal_id.uuid)
        with self._lock:
            if goal_id in self._goals and goal_id not in self._results:
                waiting = self._waiting.setdefault(goal_id, [])
                if len(waiting) < _MOST_WAITING:
                    waiting.append(responder)
                else:
                    responder.fail(f"{_MOST_WAITING} requests wait for the result of this goal already")
                return
            parts = self._results.get(goal_id)
        unknown = zero_message(self._type.get_result.response)
        responder.respond_encoded(parts or self._type.get_result.response.encode(unknown))

    def _publish_status(self) -> None:
        message = zero_message(self._type.status)
        with self._lock:
            for goal_id, entry in self._entries.items():
                entry.status = int(self._goals[goal_id].status)
                message.status_list.append(entry)
            self._status.publish(message)

    def _entry(self, handle: GoalHandle) -> Any:
        entry = zero_message(self._type.status.nested("action_msgs/msg/GoalStatus"))
        entry.goal_info = _goal_info(self._type.status, handle)
        return entry

    def _forget_old(self) -> None:
        for goal_id in list(self._results)[:-_ENDED_KEPT]:
            del self._goals[goal_id], self._entries[goal_id], self._results[goal_id]


def _is_meant(handle: GoalHandle, goal_id: bytes, until_ns: int) -> bool:
    """Tell whether a request to cancel means the goal: by its id, by its time, or because all are meant."""
    if not any(goal_id):
        return not until_ns or handle.stamp_ns <= until_ns
    return handle.goal_id == goal_id or (until_ns > 0 and handle.stamp_ns <= until_ns)


def _goal_info(owner: MessageType, handle: GoalHandle) -> Any:
    info = zero_message(owner.nested("action_msgs/msg/GoalInfo"))
    info.goal_id.uuid[:] = list(handle.goal_id)
    set_stamp(info.stamp, handle.stamp_ns)
    return info
