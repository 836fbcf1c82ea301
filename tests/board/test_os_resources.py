"""Mailboxes, mutexes, conditions and semaphores between callbacks of one board."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_board import Tickets, small_board, small_profile, stages, start

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.os_resources import Condition, Mailbox, Mutex, Semaphore
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import CallbackError, UsageError
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from small_board import Steps

    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.software import SoftwareContext

SUB = CallbackKind.SUB
PROFILE = small_profile(dict.fromkeys("abc", (100, 100)), osif_ns=7)
Log = list[tuple[int, str]]


class Slots:
    """A board with a slot for each of these callbacks, all started at once."""

    def __init__(self, **callbacks: Any) -> None:
        self.board = small_board(PROFILE, len(callbacks))
        self.executor = Executor(self.board, 1, len(callbacks))
        self.sources = {name: Tickets(self.board) for name in callbacks}
        for slot, (name, callback) in enumerate(callbacks.items()):
            self.executor.add_hw_callback(name, [slot], SUB, self.sources[name], callback)

    def run(self) -> Slots:
        self.executor.spin()
        for source in self.sources.values():
            source.put(1)
        self.board.environment.run(until=100_000)
        return self


def test_a_word_goes_from_slot_to_slot_and_waiting_is_a_stage() -> None:
    mailboxes: list[Mailbox] = []
    got: list[int] = []

    def sender(thread: HardwareThread) -> Steps:
        yield from thread.compute_cycles(5000)
        yield from thread.mbox_put(mailboxes[0], 2**32 + 8)

    def receiver(thread: HardwareThread) -> Steps:
        got.append((yield from thread.mbox_get(mailboxes[0])))

    slots = Slots(a=sender, b=receiver)
    mailboxes.append(Mailbox(slots.board.environment, 1))
    slots.run()
    assert got == [8]
    # Both bitstreams take 1000 ns, one after the other; the sender computes for 5000 ns and calls.
    assert stages(slots.sources["a"].timelines[0]) == {"reconfiguration": 1000, "execution": 5000, "osif": 7}
    assert stages(slots.sources["b"].timelines[0]) == {"reconfiguration": 2000, "osif": 7, "blocked": 4000}


@pytest.mark.parametrize(("word", "got"), [(np.uint8(200), 200), (np.int32(-2), 2**32 - 2), (-2, 2**32 - 2)])
def test_a_word_may_come_out_of_any_array_of_whole_numbers(word: Any, got: int) -> None:
    mailbox = Mailbox(VirtualEnvironment(), 1)
    assert mailbox.try_put(word)
    assert mailbox.try_get() == got


KINDS = {"mbox": "Mailbox", "mutex": "Mutex", "cond": "Condition", "sem": "Semaphore"}
IN_SOFTWARE = (
    *("mbox_tryget", "mbox_tryput", "mutex_trylock", "mutex_unlock"),
    *("cond_signal", "cond_broadcast", "sem_trywait", "sem_post"),
)
IN_HARDWARE = (
    *("mbox_get", "mbox_put", "mbox_tryget", "mbox_tryput", "mutex_lock", "mutex_trylock", "mutex_unlock"),
    *("cond_wait", "cond_signal", "cond_broadcast", "sem_wait", "sem_post"),
)


@pytest.mark.parametrize(
    ("call", "in_software"), [(call, True) for call in IN_SOFTWARE] + [(call, False) for call in IN_HARDWARE]
)
def test_what_is_no_object_of_its_kind_fails_the_callback_in_words(
    call: str, in_software: bool, caplog: pytest.LogCaptureFixture
) -> None:
    arguments = ("x", 1) if "put" in call else ("x",)

    def hardware(thread: HardwareThread) -> Steps:
        yield from getattr(thread, call)(*arguments)

    def software(_: object, context: SoftwareContext) -> None:
        getattr(context, call)(*arguments)

    slots = Slots(**({} if in_software else {"a": hardware}))
    if in_software:
        slots.sources["a"] = Tickets(slots.board)
        slots.executor.add_sw_callback("a", SUB, slots.sources["a"], software)
    slots.run()
    (record,) = caplog.records
    assert record.exc_info is not None
    error = record.exc_info[1]
    assert isinstance(error, UsageError)
    assert error.__context__ is None
    assert str(error).startswith(f"'x' is no {KINDS[call.partition('_')[0]]}. Give a resource of build.cfg")


@pytest.mark.parametrize("room", [0, 1])
def test_what_is_no_word_is_refused_also_by_a_full_mailbox(room: int) -> None:
    mailbox = Mailbox(VirtualEnvironment(), room)
    for put in (mailbox.put, mailbox.try_put):
        with pytest.raises(UsageError, match="'x' is no word of a mailbox"):
            put("x")  # type: ignore[operator]


def test_a_full_mailbox_blocks_and_try_does_not() -> None:
    environment = VirtualEnvironment()
    mailbox = Mailbox(environment, 2)
    assert [mailbox.try_put(word) for word in (1, 2, 3)] == [True, True, False]
    end = start(environment, mailbox.put(4))
    environment.run(until=10)
    assert not end.triggered
    assert mailbox.try_get() == 1
    environment.run(until=20)
    assert end.triggered
    assert [mailbox.try_get() for _ in range(3)] == [2, 4, None]


@settings(max_examples=60)
@given(
    size=st.integers(1, 3),
    steps=st.lists(st.sampled_from(["put", "get", "try put", "try get", "run"]), max_size=40),
)
def test_no_word_is_lost_or_doubled_and_the_order_is_kept(size: int, steps: list[str]) -> None:
    environment = VirtualEnvironment()
    mailbox = Mailbox(environment, size)
    sent: list[int] = []
    got: list[int] = []

    def put(word: int) -> Steps:
        yield from mailbox.put(word)

    def get() -> Steps:
        got.append((yield from mailbox.get()))

    puts = gets = 0
    for number, step in enumerate(steps):
        if step == "put":
            puts += 1
            sent.append(number)
            start(environment, put(number))
        elif step == "get":
            gets += 1
            start(environment, get())
        elif step == "try put" and puts == 0 and mailbox.try_put(number):
            sent.append(number)
        elif step == "try get" and gets == 0:
            word = mailbox.try_get()
            got += [] if word is None else [word]
        elif step == "run":
            environment.run(until=environment.now + 1)
    environment.run(until=environment.now + 1)
    while (word := mailbox.try_get()) is not None:
        got.append(word)
        environment.run(until=environment.now + 1)
    assert got == sent


def lock_for(thread_log: Log, mutex: list[Mutex], name: str, cycles: int) -> Any:
    def callback(thread: HardwareThread) -> Steps:
        yield from thread.mutex_lock(mutex[0])
        thread_log.append((thread._environment.now, f"{name} in"))
        yield from thread.compute_cycles(cycles)
        thread_log.append((thread._environment.now, f"{name} out"))
        yield from thread.mutex_unlock(mutex[0])

    return callback


def test_one_at_a_time_holds_a_mutex_in_the_order_of_coming() -> None:
    log: Log = []
    mutex: list[Mutex] = []
    slots = Slots(**{name: lock_for(log, mutex, name, 5000) for name in "abc"})
    mutex.append(Mutex(slots.board.environment))
    slots.run()
    assert [what for _, what in log] == ["a in", "a out", "b in", "b out", "c in", "c out"]
    assert [when for when, _ in log] == [1007, 6007, 6014, 11014, 11021, 16021]


@pytest.mark.parametrize("call", ["mutex_lock", "mutex_trylock"])
def test_a_failed_callback_gives_its_mutex_back(call: str, caplog: pytest.LogCaptureFixture) -> None:
    log: Log = []
    mutex: list[Mutex] = []

    def fails(thread: HardwareThread) -> Steps:
        yield from getattr(thread, call)(mutex[0])
        yield from thread.compute_cycles(5000)
        raise ValueError

    slots = Slots(a=fails, b=lock_for(log, mutex, "b", 1))
    mutex.append(Mutex(slots.board.environment))
    slots.run()
    assert log[0] == (6007, "b in")
    assert slots.executor.failures == {"a": 1}


def test_only_the_holder_unlocks(caplog: pytest.LogCaptureFixture) -> None:
    mutex = Mutex(VirtualEnvironment())
    assert mutex.try_lock("me")
    assert not mutex.try_lock("you")
    with pytest.raises(CallbackError, match="does not hold it"):
        mutex.unlock("you")
    mutex.unlock("me")
    assert mutex.try_lock("you")


@pytest.mark.parametrize("in_software", [False, True])
@pytest.mark.parametrize(("broadcast", "woken"), [(False, ["a"]), (True, ["a", "b"])])
def test_a_condition_wakes_one_or_all(broadcast: bool, woken: list[str], in_software: bool) -> None:
    went_on: list[str] = []
    shared: list[Condition] = []

    def waits(name: str) -> Any:
        def callback(thread: HardwareThread) -> Steps:
            yield from thread.mutex_lock(shared[0].mutex)
            yield from thread.cond_wait(shared[0])
            yield from thread.mutex_unlock(shared[0].mutex)  # fails unless it is held again
            went_on.append(name)

        return callback

    def wakes(thread: HardwareThread) -> Steps:
        yield from thread.compute_cycles(10_000)
        yield from (thread.cond_broadcast if broadcast else thread.cond_signal)(shared[0])

    def wakes_from_software(_: object, context: SoftwareContext) -> None:
        (context.cond_broadcast if broadcast else context.cond_signal)(shared[0])

    slots = Slots(a=waits("a"), b=waits("b"), **({} if in_software else {"c": wakes}))
    environment = slots.board.environment
    if in_software:
        source = Tickets(slots.board)
        slots.executor.add_sw_callback("c", SUB, source, wakes_from_software)
        source.put_at(10_000)
    shared.append(Condition(environment, Mutex(environment)))
    slots.run()
    assert went_on == woken


def test_waiting_needs_the_mutex(caplog: pytest.LogCaptureFixture) -> None:
    shared: list[Condition] = []

    def waits(thread: HardwareThread) -> Steps:
        yield from thread.cond_wait(shared[0])

    slots = Slots(a=waits)
    shared.append(Condition(slots.board.environment, Mutex(slots.board.environment)))
    assert slots.run().executor.failures == {"a": 1}


def test_a_semaphore_never_falls_below_nought() -> None:
    environment = VirtualEnvironment()
    semaphore = Semaphore(environment, 1)
    ends = [start(environment, semaphore.wait()) for _ in range(3)]
    done = []
    for _ in range(3):
        environment.run(until=environment.now + 1)
        done.append([end.triggered for end in ends])
        semaphore.post()
    assert done == [[True, False, False], [True, True, False], [True, True, True]]
    assert [semaphore.try_wait() for _ in range(2)] == [True, False]


def test_software_and_hardware_share_them() -> None:
    shared: list[Any] = []
    got: list[Any] = []

    def hardware(thread: HardwareThread) -> Steps:
        word = yield from thread.mbox_get(shared[0])
        yield from thread.sem_post(shared[1])
        got.append((word, (yield from thread.mbox_tryget(shared[0]))))
        got.append((yield from thread.mbox_tryput(shared[0], 5)))

    def software(message: object, context: SoftwareContext) -> None:
        got.append(context.sem_trywait(shared[1]))
        context.sem_post(shared[3])
        got.append(context.mutex_trylock(shared[2]))
        got.append(context.mbox_tryput(shared[0], 3))
        got.append(context.now_ns)

    slots = Slots(a=hardware)
    environment = slots.board.environment
    shared += [
        Mailbox(environment, 4),
        Semaphore(environment, 0),
        Mutex(environment),
        Semaphore(environment, 0),
    ]
    source = Tickets(slots.board)
    slots.executor.add_sw_callback("b", SUB, source, software)
    source.put_at(5000, 6000)
    slots.run()
    assert got == [False, True, True, 5000, (3, None), True, True, True, True, 6000]
    assert shared[2].try_lock("anybody")  # the software callback gave it back when it ended
    assert [shared[3].try_wait() for _ in range(3)] == [True, True, False]  # one for each of its calls


def test_threads_of_the_host_do_not_lose_a_word() -> None:
    environment = VirtualEnvironment()
    mailbox = Mailbox(environment, 1_000_000)
    environment.post = lambda *_: None  # type: ignore[method-assign] # nobody waits
    begin = threading.Barrier(4)

    def put() -> None:
        begin.wait()
        for _ in range(1000):
            mailbox.try_put(1)

    threads = [threading.Thread(target=put) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sum(mailbox.try_get() is not None for _ in range(5000)) == 4000
