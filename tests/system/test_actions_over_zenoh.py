"""An action and a parameter of a board in wall time, over Zenoh."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from reconros_zenoh.board.actions import ActionSource
from reconros_zenoh.board.board import Board
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.stack_node import StackNode
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.rmw.action_client import ActionClient, ActionEvent
from reconros_zenoh.rmw.action_server import GoalStatus
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.rmw.parameters import Parameters
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reconros_zenoh.ros.type_registry import TypeRegistry
    from reconros_zenoh.transport.base import Transport

LIMIT_S = 30


@pytest.fixture
def desktop(endpoint: str, types: TypeRegistry) -> Iterator[Transport]:
    """A session beside a board that serves /fibonacci and has a parameter `speed`."""
    environment = WallEnvironment()
    stop = environment.event()
    with ExitStack() as stack:
        stack.enter_context(ZenohRouter.open(endpoint))
        there = stack.enter_context(ZenohTransport.open(endpoint))
        here = stack.enter_context(ZenohTransport.open(endpoint))
        board = Board(environment, Context(there), read_profile("native"), (), threads=1)
        node = board.context.node("server")
        source = ActionSource(board, node, types.action("example_interfaces/Fibonacci"), "fibonacci")

        def serve(goal: Any, _: Any) -> Any:
            while goal.goal.order == 0 and not goal.is_cancel_requested and not over.wait(0.01):
                pass
            if goal.is_cancel_requested:
                goal.canceled()
            return source.result(sequence=np.arange(goal.goal.order, dtype=np.int32))

        over = threading.Event()
        executor = Executor(board, 1, 0)
        executor.add_sw_callback("serve", CallbackKind.SRV, source, serve)
        executor.spin()
        Parameters(StackNode(board, node, "~"), types).declare("speed", 3)
        loop = threading.Thread(target=environment.run, args=(stop,))
        loop.start()
        yield here
        over.set()
        environment.post(succeed_once, stop)
        loop.join()
        board.close()


class Goals:
    """Sends goals and waits for what becomes of them."""

    def __init__(self, transport: Transport, types: TypeRegistry) -> None:
        self._type = types.action("example_interfaces/Fibonacci")
        self._events: SimpleQueue[ActionEvent] = SimpleQueue()
        self.client = ActionClient(
            Context(transport).node("client"), self._type, "fibonacci", self._events.put
        )

    def send(self, order: int) -> bytes:
        """Return the id of a goal that was accepted; the session may not have heard of the server yet."""
        while True:
            goal_id = self.client.new_goal_id()
            self.client.send_goal(self._type.goal.cls(order=order), goal_id)
            event = self.next()
            if event.kind == "accepted":
                return goal_id
            assert event.kind == "unanswered"

    def next(self) -> ActionEvent:
        return self._events.get(timeout=LIMIT_S)

    def result(self) -> ActionEvent:
        while (event := self.next()).kind != "result":
            pass
        return event


def test_goals_are_reached_and_canceled(desktop: Transport, types: TypeRegistry) -> None:
    goals = Goals(desktop, types)
    goals.send(3)
    result = goals.result()
    assert (result.status, result.message.sequence.tolist()) == (GoalStatus.SUCCEEDED, [0, 1, 2])
    goal_id = goals.send(0)
    goals.client.cancel(goal_id)
    result = goals.result()
    assert (result.goal_id, result.status) == (goal_id, GoalStatus.CANCELED)


def test_a_parameter_is_read(desktop: Transport, types: TypeRegistry) -> None:
    get = types.service("rcl_interfaces/srv/GetParameters")
    heard, answers = threading.Event(), SimpleQueue[Any]()
    client = (
        Context(desktop)
        .node("client")
        .client(get, "/server/get_parameters", lambda matching: heard.set() if matching else None)
    )
    assert heard.wait(LIMIT_S)
    client.call(get.request.cls(names=["speed"]), answers.put, LIMIT_S * 10**9)
    assert answers.get(timeout=LIMIT_S).values[0].integer_value == 3
