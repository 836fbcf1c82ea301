"""Boards in a few lines: what a notebook does."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import reconros_zenoh as rz
from reconros_zenoh.ros.graph import tokens_expression

if TYPE_CHECKING:
    from pathlib import Path

WORD = "std_msgs/msg/UInt32"


def doubling(board: rz.VirtualBoard, timing: Any = None) -> None:
    """Add a software callback that publishes twice the number, unless it is odd."""
    writer = board.publisher("/out", WORD)

    def on_number(message: Any, ctx: rz.SoftwareContext) -> None:
        if message.data % 2 == 0:
            ctx.publish(writer, writer.message(data=2 * message.data))

    board.executor.add_sw_callback(
        "double", rz.SUB, board.subscription("/in", WORD), on_number, timing=timing
    )
    board.executor.spin()


def numbers(*values: int) -> list[dict[str, int]]:
    return [{"data": value} for value in values]


def test_messages_go_to_the_board_and_come_back() -> None:
    board = rz.VirtualBoard()
    doubling(board)
    heard = board.listen("/out", WORD)
    times_ms = board.round_trips(("/in", WORD), ("/out", WORD), numbers(2, 3, 4), limit_s=0.5)
    assert [message.data for message in heard] == [4, 8]
    assert times_ms.tolist()[::2] == [0, 0]
    assert np.isnan(times_ms[1])
    assert board.now_ms == 500
    assert board.status()["callbacks"]["double"]["calls"] == 3


INT = "std_msgs/msg/Int32"


@pytest.mark.parametrize(
    ("requests", "answers", "told"),
    [
        (("/inn", WORD), ("/out", WORD), "nobody on the board hears /inn. Give the board a callback with a"),
        (("/in", INT), ("/out", WORD), f"who hears /in has the type {WORD}, not {INT}. Use one type."),
        (("/in", WORD), ("/ou", WORD), "nobody on the board publishes on /ou. Give the board a publisher"),
        (("/in", WORD), ("/out", INT), f"who publishes on /out has the type {WORD}, not {INT}. Use one"),
    ],
)
def test_round_trips_without_an_end_say_which(
    requests: tuple[str, str], answers: tuple[str, str], told: str
) -> None:
    board = rz.VirtualBoard()
    doubling(board)
    board.listen("/inn", WORD)
    with pytest.raises(rz.UsageError) as caught:
        board.round_trips(requests, answers, numbers(2))
    assert str(caught.value).startswith(told)
    assert board.now_ms == 0


def test_round_trips_before_the_board_spins() -> None:
    board = rz.VirtualBoard()
    source, writer = board.subscription("in", WORD), board.publisher("out", WORD)
    board.executor.add_sw_callback("echo", rz.SUB, source, lambda msg, ctx: ctx.publish(writer, msg))
    with pytest.raises(rz.UsageError, match=r"nobody on the board hears /in\. .* call spin\(\) before this"):
        board.round_trips(("/in", WORD), ("/out", WORD), numbers(2))
    board.executor.spin()
    assert board.round_trips(("in", WORD), ("out", WORD), numbers(2)).tolist() == [0]


def test_a_modelled_board_takes_its_time_and_repeats_itself() -> None:
    times = []
    for _ in range(2):
        board = rz.VirtualBoard("miniitx-zynq7100", seed=3)
        doubling(board, rz.Cycles(666_000))  # one millisecond of a core at 666 MHz
        times.append(board.round_trips(("/in", WORD), ("/out", WORD), numbers(2, 2, 2)))
    assert times[0].tolist() == times[1].tolist()
    assert (times[0] > 1).all()
    assert board.status()["callbacks"]["double"]["timing"] == {"software": {"basis": "cycles", "ms": 1.0}}


def test_a_hardware_callback_on_a_timer() -> None:
    board = rz.VirtualBoard("miniitx-zynq7100", slots=1, software_workers=0)
    writer = board.publisher("/tick", WORD)

    def tick(thread: rz.HardwareThread) -> Any:
        count = yield from thread.compute(int)
        yield from thread.publish(writer, writer.message(data=count))

    board.executor.add_hw_callback("tick", [0], rz.TMR, board.timer(100), tick, timing=rz.Cycles(100))
    board.executor.spin()
    heard = board.listen("/tick", WORD)
    board.run(1.05)
    assert len(heard) == 10
    assert board.status()["slots"][0]["reconfigurations"] == 1


def test_two_callbacks_talk_through_service_and_action() -> None:
    board = rz.VirtualBoard()
    flip, flipped = board.service("/flip", "std_srvs/SetBool"), board.client("/flip", "std_srvs/SetBool")
    fibonacci = board.action("/fibonacci", "example_interfaces/Fibonacci")
    wanted = board.action_client("/fibonacci", "example_interfaces/Fibonacci")
    answer = board.types.service("std_srvs/SetBool").response.cls
    heard: list[Any] = []

    def on_start(_: None, ctx: rz.SoftwareContext) -> None:
        ctx.call(flipped, flipped.request(data=True))
        ctx.send_goal(wanted, wanted.goal(order=1))

    add = board.executor.add_sw_callback
    add("start", rz.TMR, board.timer(1), on_start)
    add("flip", rz.SRV, flip, lambda request, _: answer(success=not request.data, message="no"))
    add("flipped", rz.CLT, flipped, lambda response, _: heard.append(response.message))
    add("serve", rz.SRV, fibonacci, lambda _, __: fibonacci.result(sequence=np.zeros(1, np.int32)))
    add("hear", rz.CLT, wanted, lambda event, _: heard.append((event.kind, event.status)))
    board.executor.spin()
    board.run(0.0015)
    assert "no" in heard
    assert ("result", rz.GoalStatus.SUCCEEDED) in heard


BUILD_CFG = """
[General]
Name = small
[ResourceGroup@echo]
node = rosnode, "/echo"
word = rosmsg, std_msgs, msg, UInt32
sub = rossub, node, word, "/in"
pub = rospub, node, word, "/out"
[ReconosThread@echo]
SwSource = python
ResourceGroup = echo
"""
MAIN = """
import reconros_zenoh as rz

def main(app: rz.Application) -> None:
    pub = app.writer("echo", "pub")
    app.register("echo", "sub", software=lambda msg, ctx: ctx.publish(pub, msg), software_timing=rz.Cycles(9))
    app.spin()
"""


def test_a_project_folder(tmp_path: Path) -> None:
    (tmp_path / "build.cfg").write_text(BUILD_CFG)
    (tmp_path / "main.py").write_text(MAIN)
    project = rz.VirtualProject(tmp_path, "miniitx-zynq7100")
    times_ms = project.round_trips(("/in", WORD), ("/out", WORD), numbers(1, 2, 3))
    assert not np.isnan(times_ms).any()
    assert project.status()["callbacks"]["echo"]["calls"] == 3


def test_a_histogram_is_a_picture() -> None:
    figure = rz.histogram([1.0, 2.0, np.nan, 2.5], "three times")
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
    assert "three times" in figure.axes[0].get_title(loc="left")
    assert figure.axes[0].get_title(loc="right") == "median 2.00 ms, mean 1.83 ms (dashed)"


def test_a_histogram_of_nothing() -> None:
    with pytest.raises(rz.UsageError, match="Measure some first"):
        rz.histogram([np.nan])


@pytest.mark.parametrize("times", [["fast"], [[1], [2, 3]], {"a": 1}, [1, np.inf], [1, -np.inf]])
def test_a_histogram_of_what_are_no_times(times: Any) -> None:
    with pytest.raises(rz.UsageError, match=r"are no times: .* Give numbers|Give NaN for an answer that did"):
        rz.histogram(times)


NO_TIMES = (0, -1, 1e-10, np.nan, np.inf, 1e30, "1", None)


def test_what_makes_no_sense_is_refused() -> None:
    for count in (-1, 1.5, "2", None):
        with pytest.raises(rz.UsageError, match=f"a board cannot have {count!r} slots. Give 0 or more"):
            rz.VirtualBoard(slots=count)  # type: ignore[arg-type]
        for workers in ("software_workers", "hardware_workers"):
            if (workers, count) == ("hardware_workers", None):
                continue  # one per slot
            with pytest.raises(rz.UsageError, match=f"there cannot be {count!r} workers. Give 0 or more"):
                rz.VirtualBoard(**{workers: count})  # type: ignore[arg-type]
    board = rz.VirtualBoard()
    doubling(board)
    trip = ("/in", WORD), ("/out", WORD), numbers(2)
    for time in NO_TIMES:
        with pytest.raises(
            rz.UsageError, match=f"the period of a timer is {re.escape(repr(time))}: write a time above 0"
        ):
            board.timer(time)  # type: ignore[arg-type]
        with pytest.raises(
            rz.UsageError, match=f"run is {re.escape(repr(time))}: write a time above 0, at most 1000000000"
        ):
            board.run(time)  # type: ignore[arg-type]
        with pytest.raises(rz.UsageError, match=f"limit_s is {re.escape(repr(time))}: write a time above 0"):
            board.round_trips(*trip, limit_s=time)  # type: ignore[arg-type]
    with pytest.raises(rz.UsageError, match="keeps none"):
        board.subscription("/in", WORD, rz.QosProfile(depth=0))


def test_fields_of_a_message_that_are_not_those_of_its_type() -> None:
    board = rz.VirtualBoard()
    doubling(board)
    told = f"Give a message of type {WORD} its fields, data: 'dta' is none of them, 'data' is missing."
    with pytest.raises(rz.UsageError) as caught:
        board.round_trips(("/in", WORD), ("/out", WORD), [{"dta": 1}])
    assert str(caught.value) == told
    flip = board.client("/flip", "std_srvs/srv/SetBool")
    go = "example_interfaces/action/Fibonacci"
    makers = (board.publisher("/out", WORD).message, flip.request, board.action_client("/go", go).goal)
    for make in (*makers, board.action("/go", go).result, board.action("/go", go).feedback):
        with pytest.raises(rz.UsageError, match="'dta' is none of them"):
            make(dta=1)


def test_round_trips_that_fail_leave_nothing_in_the_network() -> None:
    board = rz.VirtualBoard()
    doubling(board)
    transport = board.desktop.context.transport
    before = transport.tokens(tokens_expression(0), 0)
    with pytest.raises(rz.UsageError, match="none of them"):
        board.round_trips(("/in", WORD), ("/out", WORD), [{"dta": 1}])
    assert transport.tokens(tokens_expression(0), 0) == before


def test_a_board_whose_callbacks_nobody_has_started_does_not_run() -> None:
    board = rz.VirtualBoard()
    board.run(1)  # there is nothing to start
    board.executor.add_sw_callback("tick", rz.TMR, board.timer(100), lambda _, ctx: None)
    with pytest.raises(rz.UsageError, match=r"callbacks that never run\. Call board\.executor\.spin\(\)"):
        board.run(1)
    board.executor.spin()
    board.run(np.int32(1))
    assert board.status()["callbacks"]["tick"]["calls"] == 9


def test_a_profile_of_ones_own_is_a_path_or_its_name(tmp_path: Path) -> None:
    shipped = files("reconros_zenoh.board") / "profiles" / "native.toml"
    own = tmp_path / "mine.toml"
    own.write_text(shipped.read_text().replace('name = "native"', 'name = "mine"'))
    for profile in (own, str(own)):
        assert rz.VirtualBoard(profile).status()["profile"] == "mine"
