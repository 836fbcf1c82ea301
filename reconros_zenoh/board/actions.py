"""Action servers and clients of a board."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.board.sources import Event, Source
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.stack_node import StackNode
from reconros_zenoh.errors import BadMessageError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.rmw.action_client import ActionClient
from reconros_zenoh.rmw.action_server import ActionServer
from reconros_zenoh.ros.message_arrays import snapshot

if TYPE_CHECKING:
    from reconros_zenoh.board.board import Board
    from reconros_zenoh.rmw.action_client import ActionEvent
    from reconros_zenoh.rmw.action_server import GoalHandle
    from reconros_zenoh.rmw.node import Node
    from reconros_zenoh.ros.types import ActionType

_DEPTH = 10
_ID_BYTES = 16


class ActionSource(Source):
    """An action server: ready while an accepted goal waits; the callback gets its `GoalHandle`.

    What the callback returns is the result. When it raises, the goal is aborted. At most 10 goals wait,
    further ones are not accepted, nor are those that the callback's `check` refuses. A goal that is canceled
    while it waits is started all the same, with `is_cancel_requested`.
    """

    kind = CallbackKind.SRV

    def __init__(self, board: Board, node: Node, action_type: ActionType, name: str) -> None:
        super().__init__()
        self._board = board
        self._node = StackNode(board, node, name)
        self._type = action_type
        self._name = name

    def begin(self) -> None:
        """Serve."""
        self._server = ActionServer(self._node, self._type, self._name, self._on_goal, self._accept)

    def result(self, **fields: object) -> Any:
        """Return a result of the action's type with these fields."""
        return self._type.result.message(**fields)

    def feedback(self, **fields: object) -> Any:
        """Return feedback of the action's type with these fields."""
        return self._type.feedback.message(**fields)

    def take(self) -> Event:
        """Begin to work on the oldest goal."""
        event = super().take()
        self._server.execute(event.message)
        return event

    def answer(self, event: Event, response: object) -> None:
        """Send the result to everyone who waits for it."""
        self._server.finish(event.message, response)
        self._board.spans.add(event.timeline)

    def fail(self, event: Event, text: str) -> None:  # noqa: ARG002 - an aborted goal has no room for the reason
        """Abort the goal."""
        self._server.fail(event.message)

    def _accept(self, goal: Any) -> None:
        if len(self._queue) >= _DEPTH:
            self._dropped += 1
            raise BadMessageError("goal_queue", f"{_DEPTH} goals wait already")
        if self._check is not None:
            self._check(goal)

    def _on_goal(self, handle: GoalHandle, request: Event) -> None:
        self.enqueue(Event(handle, request.timeline, lasting=True))


class ActionClientSource(Source):
    """An action client: callbacks send goals with it, and it is ready while an `ActionEvent` waits.

    Of feedback that nobody takes the last 10 are kept; everything else waits however long it takes.
    """

    kind = CallbackKind.CLT
    checks = False

    def __init__(self, board: Board, node: Node, action_type: ActionType, name: str) -> None:
        super().__init__()
        self._board = board
        self._type = action_type
        self._client = ActionClient(StackNode(board, node, name), action_type, name, self._on_event)

    def goal(self, **fields: object) -> Any:
        """Return a goal of the action's type with these fields."""
        return self._type.goal.message(**fields)

    def new_goal_id(self) -> bytes:
        """Return the id of a new goal: 16 bytes; callable from any thread."""
        return self._client.new_goal_id()

    def copy(self, goal: object) -> object:
        """Return the goal as it is now; callable from any thread.

        Raises UsageError when it is not of the action's type.
        """
        self._type.goal.encode(goal, joined_at_once=True)
        return snapshot(goal)

    def checked_id(self, goal_id: bytes) -> bytes:
        """Return the id of a goal, which cannot change any more; callable from any thread.

        Raises UsageError for what is no goal id.
        """
        if not isinstance(goal_id, bytes | bytearray | memoryview) or len(goal_id) != _ID_BYTES:
            raise UsageError(
                f"{goal_id!r} is no goal id. Give the {_ID_BYTES} bytes that `send_goal` has returned."
            )
        return bytes(goal_id)

    def send_goal(self, goal: object, goal_id: bytes) -> None:
        """Send a goal; called by the event loop. Raises UsageError when it is not of the action's type."""
        self._client.send_goal(goal, goal_id)

    def cancel_goal(self, goal_id: bytes) -> None:
        """Ask for a goal to end early; called by the event loop. Raises UsageError for what is no goal id."""
        self._client.cancel(self.checked_id(goal_id))

    def _on_event(self, happened: ActionEvent) -> None:
        if happened.kind == "feedback":
            feedback = [place for place, event in enumerate(self._queue) if event.message.kind == "feedback"]
            if len(feedback) >= _DEPTH:
                del self._queue[feedback[0]]
                self._dropped += 1
        environment = self._board.environment
        self.enqueue(Event(happened, Timeline(environment, environment.now)))
