"""A callback that raises: counted and logged, the client of a service is told, and the board goes on."""

from __future__ import annotations

import logging
import sys
from typing import TYPE_CHECKING, Any

import pytest
from octets import OCTETS, octets
from small_board import Tickets, desktop, small_board, small_profile, start, types

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.hmt import FifoPlan, HmtSource, HmtWriter
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.errors import TransportError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from small_board import Steps

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

PROFILE = small_profile({"a": (100, 100)}, osif_ns=7)


class NoughtError(Exception):
    """What the callbacks here raise."""


class SpeechlessError(Exception):
    """Fails when it is asked what it says."""

    def __str__(self) -> str:
        raise NoughtError

    __repr__ = __str__


def speechless() -> None:
    raise SpeechlessError


def one_failure(caplog: pytest.LogCaptureFixture, callback: str, error: type[Exception]) -> str:
    """The text of the one record, which has the traceback."""
    (record,) = caplog.records
    assert record.levelno == logging.ERROR
    assert record.getMessage().startswith(f"callback {callback} failed after ")
    assert record.exc_info is not None
    assert record.exc_info[0] is error
    assert record.exc_info[2] is not None
    return str(record.exc_info[1])


def software_board(board: Board) -> tuple[Executor, Tickets]:
    """Fails for the message 0."""

    def callback(message: int, _: SoftwareContext) -> float:
        if message == 0:
            raise NoughtError("nought")
        return 1 / message

    executor, source = Executor(board, 1, 0), Tickets(board)
    executor.add_sw_callback("a", CallbackKind.SUB, source, callback)
    executor.spin()
    return executor, source


def test_a_callback_in_software(caplog: pytest.LogCaptureFixture) -> None:
    board = small_board(PROFILE)
    executor, source = software_board(board)
    source.put_at(0, 10)
    board.environment.run(until=1000)
    assert one_failure(caplog, "a", NoughtError) == "nought"
    assert executor.calls == {"a": 2}
    assert executor.failures == {"a": 1}
    # The worker was busy for as long as the callback takes; then it took the next message.
    assert source.answers == [(10, 0.1)]
    assert [timeline.age_ns for timeline in source.timelines] == [100, 190]


def test_a_callback_that_fails_before_any_time_has_passed(caplog: pytest.LogCaptureFixture) -> None:
    board = small_board(small_profile({"a": (0, 0)}))
    _, source = software_board(board)
    source.put(0)
    board.environment.run(until=1)
    assert caplog.messages == ["callback a failed after 0 ms; a failure of this kind is not reported again"]


@pytest.mark.parametrize("when", ["before the computation", "in the kernel", "after it"])
def test_a_callback_in_hardware(when: str, caplog: pytest.LogCaptureFixture) -> None:
    def thread(thread: HardwareThread) -> Steps:
        message = yield from thread.get_init_data()
        if message:
            return "well"
        if when == "before the computation":
            raise NoughtError(when)

        def kernel() -> None:
            if when == "in the kernel":
                raise NoughtError(when)

        yield from thread.compute(kernel)
        raise NoughtError(when)

    board = small_board(PROFILE, 1)
    executor, source = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback("a", [0], CallbackKind.SUB, source, thread)
    executor.spin()
    source.put_at(0, 500)
    board.environment.run(until=5000)
    assert one_failure(caplog, "a", NoughtError) == when
    assert executor.failures == {"a": 1}
    assert source.answers == [(500, "well")]
    # The slot is free again and still holds the bitstream.
    slot = board.slots[0]
    assert slot.reconfigurations == 1
    assert slot.busy.ns == (14 if when == "before the computation" else 114)


def test_each_way_to_fail_is_logged_once_and_every_failure_is_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def fails(way: str, _: SoftwareContext) -> None:
        if way == "here":
            raise NoughtError(way)
        if way == "there":
            raise NoughtError(way)
        raise KeyError(way) if way == "otherwise" else NoughtError(way)

    board = small_board(small_profile({"a": (100, 100), "b": (100, 100)}))
    executor = Executor(board, 1, 0)
    a, b = Tickets(board), Tickets(board)
    executor.add_sw_callback("a", CallbackKind.SUB, a, fails)
    executor.add_sw_callback("b", CallbackKind.SUB, b, fails)
    executor.spin()
    for way in ("here", "there", "here", "otherwise", "so", "there"):
        a.put(way)
    b.put("here")
    board.environment.run(until=1000)
    assert executor.failures == {"a": 6, "b": 1}
    told = sorted(str(record.exc_info[1]) for record in caplog.records if record.exc_info)
    assert told == ["'otherwise'", "here", "here", "so", "there"]
    for record in caplog.records:
        assert record.getMessage().endswith(" ms; a failure of this kind is not reported again")


def test_what_a_failed_callback_wanted_to_publish_is_not_published(caplog: pytest.LogCaptureFixture) -> None:
    board = small_board(PROFILE)
    word = types().message("std_msgs/msg/UInt32")
    node = board.context.node("server")
    writer = TopicWriter(board, node, word, "out")
    got: list[int] = []
    desktop(board).node("client").subscription(
        word, "out", lambda received: got.append(received.message.data)
    )

    def callback(message: Any, context: SoftwareContext) -> None:
        context.publish(writer, writer.message(data=message.data))
        if message.data == 0:
            raise NoughtError

    executor = Executor(board, 1, 0)
    source = SubscriptionSource(board, node, word, "in")
    executor.add_sw_callback("a", CallbackKind.SUB, source, callback)
    executor.spin()
    publisher = desktop(board).node("other").publisher(word, "in")
    for number in (0, 1):
        publisher.publish(word.cls(data=number))
    board.environment.run(until=1000)
    assert got == [1]
    assert board.spans._messages["a"].count == 1
    one_failure(caplog, "a", NoughtError)


def test_a_message_that_cannot_be_encoded_is_a_failure_of_its_callback(
    caplog: pytest.LogCaptureFixture,
) -> None:
    board = small_board(PROFILE)
    writer = TopicWriter(board, board.context.node("server"), types().message("std_msgs/msg/UInt32"), "out")

    def callback(_: object, context: SoftwareContext) -> None:
        context.publish(writer, writer.message(data="seven"))

    executor, source = Executor(board, 1, 0), Tickets(board)
    executor.add_sw_callback("a", CallbackKind.SUB, source, callback)
    executor.spin()
    source.put("ticket")
    board.environment.run(until=1000)
    assert executor.failures == {"a": 1}
    assert "std_msgs/msg/UInt32 cannot be serialised" in str(caplog.records[0].exc_info)


@pytest.mark.parametrize("way", ["software", "hardware", "stream"])
def test_a_message_of_another_type_is_not_published(way: str, caplog: pytest.LogCaptureFixture) -> None:
    board = small_board(PROFILE, 1)
    word, node = types().message("std_msgs/msg/UInt32"), board.context.node("server")
    topic = board.hardware_topic("/out", word)
    writer = HmtWriter(topic) if way == "stream" else TopicWriter(board, node, word, "/out")
    message = types().message("std_msgs/msg/Int32").cls(data=7)
    got: list[object] = []
    desktop(board).node("client").subscription(word, "/out", got.append)

    def thread(thread: HardwareThread) -> Steps:
        yield from thread.publish(writer, message)

    executor, source = Executor(board, 1, 1), Tickets(board)
    if way == "software":
        executor.add_sw_callback(
            "a", CallbackKind.SUB, source, lambda _, context: context.publish(writer, message)
        )
    else:
        executor.add_hw_callback("a", [0], CallbackKind.SUB, source, thread)
    executor.spin()
    source.put("ticket")
    board.environment.run(until=10_000)
    assert not got
    assert topic.passed == 0
    told = "A message of type std_msgs/msg/UInt32 is wanted, not one of type std_msgs/msg/Int32."
    assert one_failure(caplog, "a", UsageError) == told


class ServiceBoard:
    """A service whose callback answers `yes`, raises, or returns what is no response."""

    def __init__(self, *, in_hardware: bool) -> None:
        self.board = small_board(PROFILE, 1)
        self.type = types().service("std_srvs/srv/SetBool")
        self.executor = Executor(self.board, 1, 1)
        source = ServiceSource(self.board, self.board.context.node("server"), self.type, "ask")
        self.returns: Any = None
        if in_hardware:
            self.executor.add_hw_callback("a", [0], CallbackKind.SRV, source, self._thread)
        else:
            self.executor.add_sw_callback("a", CallbackKind.SRV, source, self._function)
        self.executor.spin()
        self._client = desktop(self.board).node("client").client(self.type, "ask")
        self.answers: list[Any] = []

    def call(self, *, returns: object) -> object:
        """Return what the client gets when the callback returns this, or raises it."""
        self.returns = returns
        self._client.call(self.type.request.cls(data=True), self.answers.append, 10**9)
        before = len(self.answers)
        self.board.environment.run(until=self.board.environment.now + 10_000)
        assert len(self.answers) == before + 1, "one answer, long before the timeout"
        return self.answers[-1]

    def yes(self) -> object:
        return self.type.response.cls(success=True, message="yes")

    def _function(self, _: object, __: SoftwareContext) -> object:
        if isinstance(self.returns, Exception):
            raise self.returns
        return self.returns

    def _thread(self, _: HardwareThread) -> Steps:
        yield from ()
        return self._function(None, None)  # type: ignore[arg-type] # it uses neither


@pytest.mark.parametrize("in_hardware", [True, False], ids=["hardware", "software"])
def test_the_client_of_a_service_is_told(in_hardware: bool, caplog: pytest.LogCaptureFixture) -> None:
    service = ServiceBoard(in_hardware=in_hardware)
    answer = service.call(returns=NoughtError("no numbers"))
    assert isinstance(answer, TransportError)
    assert str(answer) == "service /ask refused: callback a failed: no numbers"
    one_failure(caplog, "a", NoughtError)
    assert service.call(returns=service.yes()) == service.yes()
    assert service.executor.failures == {"a": 1}


def test_an_error_that_cannot_say_what_it_is_harms_nobody(caplog: pytest.LogCaptureFixture) -> None:
    service = ServiceBoard(in_hardware=True)
    answer = service.call(returns=SpeechlessError())
    assert str(answer) == "service /ask refused: callback a failed: it cannot say why"
    assert service.call(returns=service.yes()) == service.yes()
    assert service.executor.failures == {"a": 1}


@pytest.mark.parametrize("in_hardware", [True, False], ids=["hardware", "software"])
@pytest.mark.parametrize("returns", [None, "yes", 7])
def test_a_service_callback_that_returns_no_response_has_failed(
    in_hardware: bool, returns: object, caplog: pytest.LogCaptureFixture
) -> None:
    service = ServiceBoard(in_hardware=in_hardware)
    answer = service.call(returns=returns)
    assert isinstance(answer, TransportError)
    assert str(answer) == (
        "service /ask refused: callback a failed: A message of type std_srvs/srv/SetBool_Response is wanted, "
        f"not {returns!r}."
    )
    assert len(caplog.records) == 1
    assert service.executor.failures == {"a": 1}
    assert service.call(returns=service.yes()) == service.yes()


@pytest.mark.parametrize("end", [lambda: sys.exit(3), lambda: iter(()).__next__()])
@pytest.mark.parametrize("limit_ms", [None, 1000.0])
def test_a_callback_in_software_that_wants_to_end_the_board(
    end: Callable[[], object], limit_ms: float | None, caplog: pytest.LogCaptureFixture
) -> None:
    board = small_board(PROFILE)
    executor, source = Executor(board, 1, 0), Tickets(board)
    executor.add_sw_callback("a", CallbackKind.SUB, source, lambda _, __: end(), limit_ms=limit_ms)
    executor.spin()
    source.put(1)
    source.put(2)
    board.environment.run(until=1000)
    assert executor.failures == {"a": 2}


@pytest.mark.parametrize("limit_ms", [None, 1000.0])
def test_hardware_callbacks_that_are_not_written_as_they_must_be(
    limit_ms: float | None, caplog: pytest.LogCaptureFixture
) -> None:
    def leaves(_: HardwareThread) -> Steps:
        sys.exit(3)
        yield

    def forgets_from(thread: HardwareThread) -> Any:
        yield thread.get_init_data()

    def waits_for_nothing(_: HardwareThread) -> Any:
        yield

    callbacks: dict[Callable[[HardwareThread], Any], str] = {
        leaves: "3",
        forgets_from: "cannot be waited for. Call what takes time with `yield from`.",
        waits_for_nothing: "None cannot be waited for. Call what takes time with `yield from`.",
        lambda _: 5: "a hardware callback is a generator, this one returned 5. Call what takes time",
        lambda _: None: "a hardware callback is a generator, this one returned None. Call what takes time",
        lambda _: [7]: "a hardware callback is a generator, this one returned [7]. Call what takes time",
    }
    for callback, text in callbacks.items():
        caplog.clear()
        board = small_board(PROFILE, 1)
        executor, source = Executor(board, 0, 1), Tickets(board)
        executor.add_hw_callback("a", [0], CallbackKind.SUB, source, callback, limit_ms=limit_ms)
        executor.spin()
        source.put(1)
        source.put(2)
        board.environment.run(until=100_000)
        assert executor.failures == {"a": 2}, callback
        assert text in str(caplog.records[0].exc_info[1])  # type: ignore[index]


@pytest.mark.parametrize("way", ["network", "board", "stream", "stream with overhead"])
@pytest.mark.parametrize(
    "wrong", [lambda: sys.exit(3), lambda: {}["no"], speechless], ids=["exit", "error", "speechless"]
)
def test_a_check_that_fails_itself_refuses_the_message_and_harms_nobody(
    way: str, wrong: Callable[[], Any], caplog: pytest.LogCaptureFixture
) -> None:
    overhead_ns = 7 if way == "stream with overhead" else 0
    board = small_board(
        small_profile(
            {"picky": (0, 0), "patient": (0, 0)},
            hmt_overhead_ns=overhead_ns,
            topics={} if way == "board" else None,
        ),
        slots=2,
    )
    topic, node = board.hardware_topic("/a", OCTETS), board.context.node("n")

    def check(message: Any) -> None:
        if message.data[0] == 0:
            wrong()

    heard: dict[str, list[int]] = {"picky": [], "patient": []}

    def listen(name: str) -> Callable[[HardwareThread], Steps]:
        def thread(thread: HardwareThread) -> Steps:
            message = yield from thread.get_init_data()
            heard[name].append(int(message.data[0]))

        return thread

    executor = Executor(board, 0, 2)
    for slot, name in enumerate(heard):
        source = (
            HmtSource(board, topic, FifoPlan())
            if way.startswith("stream")
            else SubscriptionSource(board, node, OCTETS, "/a")
        )
        executor.add_hw_callback(
            name, [slot], CallbackKind.SUB, source, listen(name), check if name == "picky" else None
        )
    executor.spin()
    publisher = desktop(board).node("c").publisher(OCTETS, "/a")
    writer = HmtWriter(topic) if way.startswith("stream") else board.writer(node, OCTETS, "/a")
    # More than a FIFO holds: a message that is refused must give its place back.
    for value in (0, 0, 0, 1):
        if way == "network":
            publisher.publish(octets([value]))
        else:
            timeline = Timeline(board.environment, board.environment.now)
            start(board.environment, writer.publish(octets([value]), timeline))
    board.environment.run(until=100_000)
    assert heard == {"picky": [1], "patient": [0, 0, 0, 1]}
    assert board.context.rejections.counts() == {"check_failed": 3}
    (text,) = caplog.messages
    assert "the check of callback picky failed: " in text
