"""The interface of a hardware thread: Listings 2 and 3 line by line, page faults, exit, plain kernels."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from small_board import Tickets, desktop, small_board, small_profile, types

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.kernel import Kernel
from reconros_zenoh.board.sources import ServiceSource, SubscriptionSource
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.errors import UsageError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.callback import HardwareThread

PROFILE = small_profile({"filter": (0, 50)}, osif_ns=7)
IMAGE = types().message("sensor_msgs/msg/Image")
WORD = types().message("std_msgs/msg/UInt32")
PIXELS = np.arange(64, dtype=np.uint8)


def invert(ram: Any) -> Any:
    return ~ram


def image(pixels: Any = PIXELS) -> Any:
    header = types().message("std_msgs/msg/Header").cls
    time = types().message("builtin_interfaces/msg/Time").cls
    return IMAGE.cls(
        header=header(stamp=time(sec=1, nanosec=2), frame_id="camera"),
        height=8,
        width=8,
        encoding="mono8",
        is_bigendian=0,
        step=8,
        data=pixels,
    )


class Filter:
    """A board whose slot runs one callback of /filter for each image that the desktop sends."""

    def __init__(self, board: Board, thread: Any) -> None:
        self.board = board
        node = board.context.node("filter")
        self.writer = TopicWriter(board, node, IMAGE, "/image_filtered")
        self.executor = Executor(board, 0, 1)
        source = SubscriptionSource(board, node, IMAGE, "/image_raw")
        self.executor.add_hw_callback("filter", [0], CallbackKind.SUB, source, thread(self))
        self.executor.spin()
        self.got: list[Any] = []
        client = desktop(board).node("client")
        client.subscription(IMAGE, "/image_filtered", lambda received: self.got.append(received.message))
        self.publisher = client.publisher(IMAGE, "/image_raw")

    def run(self, *images: Any) -> None:
        for message in images:
            self.publisher.publish(message)
        self.board.environment.run(until=self.board.environment.now + 1_000_000)


def listing_2(case: Filter) -> Any:
    def callback(thread: HardwareThread) -> Steps:
        p_msg = yield from thread.get_init_data()
        p_msg += thread.offsetof(IMAGE, "data.data")
        p_payload = yield from thread.mem_read(p_msg, 4)
        ram = yield from thread.mem_read(p_payload[0], 64, np.uint8)
        ram = yield from thread.compute(invert, ram)
        yield from thread.mem_write(ram, p_payload[0])
        message = yield from thread.get_init_data()
        yield from thread.publish(case.writer, message)
        yield from thread.exit()
        raise AssertionError("nothing runs after the exit")

    return callback


def test_listing_2() -> None:
    case = Filter(small_board(PROFILE, 1), listing_2)
    sent = image()
    case.run(sent)
    (got,) = case.got
    assert got.data.tolist() == invert(PIXELS).tolist()
    assert (got.header.frame_id, got.encoding, got.width) == ("camera", "mono8", 8)
    assert sent.data.tolist() == PIXELS.tolist()
    # 4 + 64 + 64 bytes at 1 B/ns, four calls of 7 ns through the delegate, 50 ns of computing.
    spans = case.board.spans.mean_ms()["filter"]
    assert spans["memif"] == pytest.approx(132e-6)
    assert spans["osif"] == pytest.approx(3 * 7e-6)  # the exit comes after what was published
    assert spans["execution"] == pytest.approx(50e-6)
    assert case.board.slots[0].busy.ns == 132 + 4 * 7 + 50
    assert not case.board.memory._blocks
    assert case.executor.failures == {}


def test_a_64_bit_board_has_pointers_of_two_words() -> None:
    def walk(case: Filter) -> Any:
        def callback(thread: HardwareThread) -> Steps:
            init = yield from thread.get_init_data()
            pointer = yield from thread.mem_read(init + thread.offsetof(IMAGE, "data.data"), 8, np.uint64)
            ram = yield from thread.mem_read(pointer[0], 64, np.uint8)
            assert ram.tolist() == init.data.tolist()
            yield from thread.publish(case.writer, init)

        return callback

    case = Filter(small_board(PROFILE, 1, pointer_bytes=8), walk)
    case.run(image())
    assert len(case.got) == 1


FAULTS = {
    "beyond the image": ("data.data", 0, 65),
    "before the image": ("data.data", -1, 4),
    "a number taken for a pointer": ("height", 0, 4),
    "a pointer of nothing": ("data.data", -0x1000_0000, 4),
}


@pytest.mark.parametrize("access", ["read", "write"])
@pytest.mark.parametrize(("field", "offset", "size"), FAULTS.values(), ids=FAULTS.keys())
def test_a_page_fault_fails_the_callback_and_the_board_goes_on(
    field: str, offset: int, size: int, access: str, caplog: pytest.LogCaptureFixture
) -> None:
    wrong: list[int] = []

    def stray(case: Filter) -> Any:
        def callback(thread: HardwareThread) -> Steps:
            init = yield from thread.get_init_data()
            pointer = yield from thread.mem_read(init + thread.offsetof(IMAGE, field), 4)
            if init.height == 8:
                wrong.append(int(pointer[0]) + offset)
                if access == "read":
                    yield from thread.mem_read(wrong[0], size)
                yield from thread.mem_write(np.zeros(size, np.uint8), wrong[0])
            yield from thread.publish(case.writer, init)

        return callback

    case = Filter(small_board(PROFILE, 1), stray)
    good = image()
    good.height = 9
    case.run(image(), good)
    assert [message.height for message in case.got] == [9]
    assert case.executor.failures == {"filter": 1}
    (record,) = caplog.records
    assert record.getMessage().startswith("callback filter failed after ")
    assert record.exc_info is not None
    assert str(record.exc_info[1]) == (
        f"page fault: callback filter in slot 0 cannot {access} {size} bytes at {wrong[0]:#x}, which do not "
        "lie in one block of its memory. Check the offset, the length and the pointer."
    )
    assert not case.board.memory._blocks


NO_TRANSFERS = {
    "a number": (
        lambda thread, init: thread.mem_read(init.height),
        r'mem_read of a int .* message\.array\("field"\), or an address',
    ),
    "an address alone": (lambda thread, init: thread.mem_read(init), "mem_read of a InitData .*None"),
    "a list to read": (lambda thread, _: thread.mem_read([1, 2]), "mem_read of a list with the size None"),
    "no address": (lambda thread, _: thread.mem_read(None, 4), "mem_read of a NoneType with the size 4"),
    "half bytes": (lambda thread, init: thread.mem_read(init, 4.5), r"mem_read of a InitData .*4\.5"),
    "a number to write": (lambda thread, init: thread.mem_write(5, init), "mem_write of 5: give an array"),
    "a list to write": (lambda thread, _: thread.mem_write([1, 2]), r"mem_write of \[1, 2\]: give an array"),
}


@pytest.mark.parametrize(("transfer", "told"), NO_TRANSFERS.values(), ids=NO_TRANSFERS)
def test_what_cannot_be_transferred_fails_the_callback_in_words(
    transfer: Any, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    def transfers(_: Filter) -> Any:
        def callback(thread: HardwareThread) -> Steps:
            yield from transfer(thread, (yield from thread.get_init_data()))

        return callback

    case = Filter(small_board(PROFILE, 1), transfers)
    case.run(image())
    (record,) = caplog.records
    assert record.exc_info is not None
    assert isinstance(record.exc_info[1], UsageError)
    assert re.match(told, str(record.exc_info[1]))


def test_a_message_with_a_broken_pointer_is_not_published(caplog: pytest.LogCaptureFixture) -> None:
    def breaks(case: Filter) -> Any:
        def callback(thread: HardwareThread) -> Steps:
            init = yield from thread.get_init_data()
            yield from thread.mem_write(np.array([4], np.uint32), init + thread.offsetof(IMAGE, "data.data"))
            yield from thread.publish(case.writer, init)

        return callback

    case = Filter(small_board(PROFILE, 1), breaks)
    case.run(image())
    assert not case.got
    assert case.executor.failures == {"filter": 1}
    assert "cannot publish" in str(caplog.records[0].exc_info[1])  # type: ignore[index]


def test_what_was_published_does_not_change_when_the_callback_writes_again() -> None:
    def twice(case: Filter) -> Any:
        def callback(thread: HardwareThread) -> Steps:
            init = yield from thread.get_init_data()
            pointer = yield from thread.mem_read(init + thread.offsetof(IMAGE, "data.data"), 4)
            for value in (1, 2):
                yield from thread.mem_write(np.full(100_000, value, np.uint8), pointer[0])
                yield from thread.publish(case.writer, init)

        return callback

    case = Filter(small_board(PROFILE, 1), twice)
    case.run(image(np.zeros(100_000, np.uint8)))
    assert [message.data[0] for message in case.got] == [1, 2]


def test_a_plain_kernel_with_declared_transfers() -> None:
    def kernel(case: Filter) -> Any:
        reads = ("data", "height", "header.stamp.nanosec")
        return Kernel(add, reads, lambda message, result: image(result), case.writer)

    def add(ram: Any, height: Any, nanosec: Any) -> Any:
        return ram + height.astype(np.uint8) * nanosec.astype(np.uint8)

    case = Filter(small_board(PROFILE, 1), kernel)
    case.run(image())
    assert case.got[0].data.tolist() == (PIXELS + 16).tolist()
    # 64 bytes in and out, and the height and a part of the header.
    assert case.board.slots[0].busy.ns == (64 + 4 + 4 + 64) + 2 * 7 + 50


def test_a_plain_kernel_answers_a_service() -> None:
    board = small_board(PROFILE, 1)
    service = types().service("std_srvs/srv/SetBool")
    source = ServiceSource(board, board.context.node("filter"), service, "flip")
    executor = Executor(board, 0, 1)
    kernel = Kernel(
        np.logical_not, ("data",), lambda _, result: service.response.cls(success=bool(result[0]), message="")
    )
    executor.add_hw_callback("filter", [0], CallbackKind.SRV, source, kernel)
    executor.spin()
    answers: list[Any] = []
    desktop(board).node("client").client(service, "flip").call(
        service.request.cls(data=False), answers.append, 10**9
    )
    board.environment.run(until=1_000_000)
    assert [answer.success for answer in answers] == [True]


def test_exit_ends_the_callback_with_its_answer() -> None:
    def leaves(thread: HardwareThread) -> Steps:
        yield from thread.exit("early")

    board = small_board(PROFILE, 1)
    executor, source = Executor(board, 0, 1), Tickets(board)
    executor.add_hw_callback("filter", [0], CallbackKind.SUB, source, leaves)
    executor.spin()
    source.put(1)
    board.environment.run(until=10_000)
    assert source.answers == [(1, "early")]
    assert board.slots[0].busy.ns == 7


def test_what_a_timer_starts_has_no_address() -> None:
    board = small_board(PROFILE, 1)
    executor, source = Executor(board, 0, 1), Tickets(board)
    got: list[Any] = []

    def callback(thread: HardwareThread) -> Steps:
        got.append((yield from thread.get_init_data()))

    executor.add_hw_callback("filter", [0], CallbackKind.TMR, source, callback)
    executor.spin()
    source.put(None)
    board.environment.run(until=10_000)
    assert got == [None]
