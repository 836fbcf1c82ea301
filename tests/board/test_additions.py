"""What a callback may be added with: mistakes are told there, in words of the one who made them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import Tickets, ignore, logging_thread, small_board, small_profile, types

from reconros_zenoh.board.actions import ActionClientSource, ActionSource
from reconros_zenoh.board.clients import ClientSource
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.hmt import FifoPlan, HmtSource, HmtWriter
from reconros_zenoh.board.kernel import Kernel
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource, TimerSource
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.errors import UsageError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.board.sources import Source

TMR, SUB, SRV, CLT = CallbackKind
WORD = types().message("std_msgs/msg/UInt32")
IMAGE = types().message("sensor_msgs/msg/Image")
FLIP = types().service("std_srvs/srv/SetBool")
FIBONACCI = types().action("example_interfaces/action/Fibonacci")


class Case:
    """A board with a slot and a software worker, and one source of each sort."""

    def __init__(self, profile: str | None = None) -> None:
        self.board = small_board(read_profile(profile) if profile else small_profile({"a": (10, 10)}), 1)
        self.executor = Executor(self.board, 1, 1)
        node = self.board.context.node("n")
        self.sources: dict[str, Source] = {
            "timer": TimerSource(self.board, 1000),
            "subscription": SubscriptionSource(self.board, node, IMAGE, "/i"),
            "stream": HmtSource(self.board, self.board.hardware_topic("/s", IMAGE), FifoPlan()),
            "service": ServiceSource(self.board, node, FLIP, "flip"),
            "client": ClientSource(self.board, node, FLIP, "flop"),
            "action": ActionSource(self.board, node, FIBONACCI, "go"),
            "action client": ActionClientSource(self.board, node, FIBONACCI, "went"),
        }
        self.writer = TopicWriter(self.board, node, WORD, "/o")

    def add(
        self, source: object, kind: object = SUB, thread: object = None, slots: object = (0,), **more: Any
    ) -> None:
        source = self.sources[source] if isinstance(source, str) and source in self.sources else source
        thread = thread or logging_thread([], "a")
        self.executor.add_hw_callback("a", slots, kind, source, thread, **more)  # type: ignore[arg-type]

    def refusal(self, *arguments: Any, **more: Any) -> str:
        with pytest.raises(UsageError) as caught:
            self.add(*arguments, **more)
        assert not self.executor.statistics()
        return str(caught.value)


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ("timer", TMR),
        ("subscription", SUB),
        ("stream", SUB),
        ("service", SRV),
        ("action", SRV),
        ("client", CLT),
        ("action client", CLT),
    ],
)
def test_a_source_has_callbacks_of_its_kind(source: str, kind: CallbackKind) -> None:
    for other in CallbackKind:
        if other is not kind:
            assert f"is of the kind {other.name}, and its source" in Case().refusal(source, other)
            if source != "stream":
                case = Case()
                with pytest.raises(UsageError, match=f"Give rz.{kind.name}, or another source"):
                    case.executor.add_sw_callback("a", other, case.sources[source], ignore)
    Case().add(source, kind)


@pytest.mark.parametrize("kind", ["SUB", 1, None])
def test_what_is_no_kind(kind: object) -> None:
    told = f"callback 'a' is of the kind {kind!r}. Give rz.TMR, rz.SUB, rz.SRV or rz.CLT."
    assert Case().refusal("subscription", kind) == told


def test_what_is_no_source() -> None:
    assert Case().refusal("/i").startswith("callback 'a' has the source '/i'. Give a timer, subscription,")
    case = Case()
    assert "callback 'a' has the source <" in case.refusal(case.writer)


@pytest.mark.parametrize("slots", [[], (), 0, None])
def test_a_hardware_callback_without_slots(slots: object) -> None:
    told = "callback 'a' has no slots to run in. Give their ids: [0]."
    assert Case().refusal("subscription", slots=slots) == told


def test_the_slots_may_come_one_by_one() -> None:
    case = Case()
    case.add("subscription", slots=iter([0]))
    assert case.executor.statistics()["a"]["slots"] == [0]


@pytest.mark.parametrize("profile", [None, "native"])
@pytest.mark.parametrize("timing", [60_000, 0, "1 ms"])
def test_what_is_no_timing(profile: str | None, timing: object) -> None:
    told = f"timing={timing!r} of callback 'a': write Cycles(n) or Native(factor)."
    assert Case(profile).refusal("subscription", timing=timing) == told
    case = Case(profile)
    with pytest.raises(UsageError, match="of callback 'a': write Cycles"):
        case.executor.add_sw_callback("a", SUB, Tickets(case.board), ignore, timing=timing)  # type: ignore[arg-type]


@pytest.mark.parametrize("qos", [1, 0, "best_effort", {"depth": 1}])
def test_what_is_no_qos(qos: Any) -> None:
    board = small_board(small_profile({}))
    modelled = small_board(small_profile({}, topics={}))
    node = board.context.node("n")
    ends: list[Callable[[], object]] = [
        lambda: SubscriptionSource(board, node, WORD, "/i", qos),
        lambda: board.writer(node, WORD, "/o", qos),
        lambda: modelled.writer(modelled.context.node("n"), WORD, "/o", qos),
        lambda: node.publisher(WORD, "/o", qos),
        lambda: node.subscription(WORD, "/o", print, qos),
    ]
    for end in ends:
        with pytest.raises(UsageError) as caught:
            end()
        assert str(caught.value) == f"qos is {qos!r}. Write a QosProfile: QosProfile(depth=10)."


@pytest.mark.parametrize(
    ("source", "kind", "told"), [("timer", TMR, "TimerSource"), ("action client", CLT, "ActionClientSource")]
)
def test_a_check_where_there_is_nothing_to_check(source: str, kind: CallbackKind, told: str) -> None:
    refused = f"callback 'a' has a check, and its source, a {told}, no messages that could be checked. "
    assert Case().refusal(source, kind, check=ignore).startswith(refused)
    case = Case()
    with pytest.raises(UsageError, match="Leave out `check`"):
        case.executor.add_sw_callback("a", kind, case.sources[source], ignore, ignore)


@pytest.mark.parametrize(
    ("source", "kind"),
    [("subscription", SUB), ("stream", SUB), ("service", SRV), ("client", CLT), ("action", SRV)],
)
def test_a_check_where_messages_come(source: str, kind: CallbackKind) -> None:
    Case().add(source, kind, check=ignore)


def kernel(case: Case, *reads: str, publish: bool = True) -> Kernel:
    return Kernel(np.sum, reads, lambda _, __: None, case.writer if publish else None)


def test_a_kernel_reads_what_there_is() -> None:
    for source, kind in {"subscription": SUB, "stream": SUB, "client": CLT}.items():
        case = Case()
        fields = ("success",) if source == "client" else ("data", "header.stamp.sec")
        case.add(source, kind, kernel(case, *fields))
    case = Case()
    case.add("timer", TMR, kernel(case))


@pytest.mark.parametrize(
    ("field", "known"),
    [
        ("dta", "; there are header, height, width, encoding, is_bigendian, step, data"),
        ("header.stamp.second", "; there are sec, nanosec"),
        ("data.size", ""),
    ],
)
def test_a_kernel_that_reads_what_there_is_not(field: str, known: str) -> None:
    for source in ("subscription", "stream"):
        case = Case()
        told = f"sensor_msgs/msg/Image has no field {field!r}{known}."
        assert case.refusal(source, SUB, kernel(case, "data", field)) == told


@pytest.mark.parametrize(("source", "kind"), [("timer", TMR), ("action client", CLT)])
def test_a_kernel_that_reads_where_there_is_no_message(source: str, kind: CallbackKind) -> None:
    case = Case()
    told = "the kernel of callback 'a' reads 'data', but no message starts it: write reads=()."
    assert case.refusal(source, kind, kernel(case, "data")) == told


def test_the_fields_of_a_kernel_in_one_word() -> None:
    with pytest.raises(UsageError) as caught:
        Kernel(np.sum, "data", lambda _, __: None)  # type: ignore[arg-type]
    assert str(caught.value) == "Kernel(reads='data'): write the fields as a tuple, ('data',)."


def test_a_kernel_publishes_or_responds() -> None:
    case = Case()
    assert "answers, but nobody has asked" in case.refusal("subscription", SUB, kernel(case, publish=False))
    assert "so its request has no response" in case.refusal("service", SRV, kernel(case))
    case.add("service", SRV, kernel(case, "data", publish=False))


def test_a_kernel_publishes_on_a_stream() -> None:
    case = Case()
    writer = HmtWriter(case.board.hardware_topic("/o", WORD))
    case.add("subscription", SUB, Kernel(np.sum, ("data",), lambda _, __: None, writer))


def test_a_callback_in_two_places_has_one_kind_and_one_check() -> None:
    board = small_board(small_profile({"a": (10, 10)}), 1)
    executor = Executor(board, 1, 1)
    source = Tickets(board)
    executor.add_sw_callback("a", SUB, source, ignore)
    for kind, check in ((SRV, None), (SUB, ignore)):
        with pytest.raises(UsageError, match="'a' is registered already with another kind or check"):
            executor.add_hw_callback("a", [0], kind, source, logging_thread([], "a"), check)


@pytest.mark.parametrize(
    ("slots", "source", "limit_ms"),
    [([0, 5], "own", None), ([0, 1], "own", None), ([0], "own", -1), ([0], "of b", None)],
    ids=["no slot", "slot of another", "limit", "source of another"],
)
def test_of_a_refused_callback_nothing_stays(slots: list[int], source: str, limit_ms: float | None) -> None:
    board = small_board(small_profile(dict.fromkeys("ab", (10, 10))), 3, static=[1])
    executor, sources = Executor(board, 0, 3), {"own": Tickets(board), "of b": Tickets(board)}
    executor.add_hw_callback("b", [1], SUB, sources["of b"], logging_thread([], "b"))
    with pytest.raises(UsageError):
        executor.add_hw_callback("a", slots, SUB, sources[source], logging_thread([], "a"), limit_ms=limit_ms)
    assert list(executor.statistics()) == ["b"]
    executor.add_hw_callback("a", [2], SUB, sources["own"], logging_thread([], "a"))
    assert executor.statistics()["a"]["slots"] == [2]
    assert [board.slots[slot].tenants for slot in range(3)] == [set(), {"b"}, {"a"}]


def test_a_source_makes_one_callback_ready() -> None:
    board = small_board(small_profile(dict.fromkeys("ab", (10, 10))))
    executor, other = Executor(board, 1, 0), Executor(board, 1, 0)
    source = Tickets(board)
    executor.add_sw_callback("a", SUB, source, ignore)
    with pytest.raises(UsageError, match="callbacks 'a' and 'b' have one source, which makes one callback r"):
        executor.add_sw_callback("b", SUB, source, ignore)
    other.add_sw_callback("b", SUB, source, ignore)
    executor.spin()
    with pytest.raises(UsageError, match="one source cannot make two callbacks ready"):
        other.spin()
