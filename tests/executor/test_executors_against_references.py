"""Events, workers and finishes in any order: both executors choose what their naive references choose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from callbacks_for_tests import EventQueue, callback, implementation
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from reference_executors import ReferenceCallback, ReferenceReconros, ReferenceStandard

from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.executor.reconros import ReconrosExecutor
from reconros_zenoh.executor.resource_mask import SOFTWARE
from reconros_zenoh.executor.standard import StandardExecutor

if TYPE_CHECKING:
    from reconros_zenoh.executor.callbacks import CallbackEntry, CallbackLists, Dispatch

resources = st.integers(SOFTWARE, 2)
callbacks = st.tuples(st.sampled_from(CallbackKind), st.frozensets(resources, min_size=1))
any_number = st.integers(0, 999)


@dataclass(eq=False)
class Worker:
    """A worker and what it runs."""

    resource: int
    running: Dispatch | None = None


class ExecutorMachine(RuleBasedStateMachine):
    """Does the same things to an executor and to its reference."""

    executor_class: ClassVar[type[ReconrosExecutor | StandardExecutor]]
    reference_class: ClassVar[type[ReferenceReconros | ReferenceStandard]]

    @initialize(drawn=st.lists(callbacks, min_size=1, max_size=8))
    def register(self, drawn: list[tuple[CallbackKind, frozenset[int]]]) -> None:
        self.executor: CallbackLists = self.executor_class()
        self.entries: list[CallbackEntry] = []
        self.models: list[ReferenceCallback] = []
        self.workers: list[Worker] = []
        self.events = 0
        for number, (kind, mask) in enumerate(drawn):
            entry = callback(f"{number}", kind, EventQueue(), mask)
            self.entries.append(entry)
            self.models.append(ReferenceCallback(entry.name, kind.name, mask))
            self.executor.add(entry)
        self.reference = self.reference_class(self.models)

    @rule(numbers=st.lists(any_number, min_size=1, max_size=6))
    def events_come(self, numbers: list[int]) -> None:
        for number in numbers:
            self.events += 1
            self.queue(number).append(self.events)
            self.model(number).events.append(self.events)
            self.executor.refresh(self.entry(number))

    @rule(number=any_number)
    def events_go(self, number: int) -> None:
        self.queue(number).clear()
        self.model(number).events.clear()
        self.executor.refresh(self.entry(number))

    @precondition(lambda self: any(worker.running is None for worker in self.workers))
    @rule(number=any_number)
    def a_worker_selects(self, number: int) -> None:
        self.select(self.idle_worker(number))

    @precondition(lambda self: any(worker.running is None for worker in self.workers))
    @rule(number=any_number)
    def a_worker_serves_until_it_finds_nothing(self, number: int) -> None:
        worker = self.idle_worker(number)
        self.select(worker)
        while worker.running is not None:
            self.finish(worker)
            self.select(worker)

    @precondition(lambda self: any(worker.running is not None for worker in self.workers))
    @rule(number=any_number)
    def a_worker_finishes(self, number: int) -> None:
        busy = [worker for worker in self.workers if worker.running is not None]
        self.finish(busy[number % len(busy)])

    def idle_worker(self, number: int) -> Worker:
        idle = [worker for worker in self.workers if worker.running is None]
        return idle[number % len(idle)]

    def select(self, worker: Worker) -> None:
        work_waits = any(model.could_start(worker.resource) for model in self.models)
        expected = self.reference.choose(worker, worker.resource)
        worker.running = self.executor.select(worker, worker.resource)
        assert (worker.running is not None) == work_waits
        if expected is None:
            assert worker.running is None
            return
        expected.running = True
        assert worker.running is not None
        assert worker.running.entry.name == expected.name
        assert worker.running.message == expected.events.pop(0)
        assert worker.running.implementation == implementation(expected.name, worker.resource)

    def finish(self, worker: Worker) -> None:
        assert worker.running is not None
        self.executor.finish(worker.running)
        self.models[self.entries.index(worker.running.entry)].running = False
        worker.running = None

    @invariant()
    def no_callback_runs_twice_at_once(self) -> None:
        running = [worker.running.entry.name for worker in self.workers if worker.running is not None]
        assert sorted(running) == sorted(model.name for model in self.models if model.running)
        assert len(set(running)) == len(running)

    @invariant()
    def every_callback_runs_where_its_mask_has_a_field(self) -> None:
        for worker in self.workers:
            assert worker.running is None or worker.resource in worker.running.entry.mask

    def entry(self, number: int) -> CallbackEntry:
        return self.entries[number % len(self.entries)]

    def model(self, number: int) -> ReferenceCallback:
        return self.models[number % len(self.models)]

    def queue(self, number: int) -> list[object]:
        source = self.entry(number).source
        assert isinstance(source, EventQueue)
        return source.events


class ReconrosMachine(ExecutorMachine):
    """Any number of software and hardware workers."""

    executor_class = ReconrosExecutor
    reference_class = ReferenceReconros

    @rule(resource=resources)
    def a_worker_starts(self, resource: int) -> None:
        self.workers.append(Worker(resource))


class StandardMachine(ExecutorMachine):
    """Any number of software workers."""

    executor_class = StandardExecutor
    reference_class = ReferenceStandard

    @rule()
    def a_worker_starts(self) -> None:
        self.workers.append(Worker(SOFTWARE))


effort = settings(max_examples=80, stateful_step_count=80)
TestReconrosExecutor = ReconrosMachine.TestCase
TestReconrosExecutor.settings = effort
TestStandardExecutor = StandardMachine.TestCase
TestStandardExecutor.settings = effort
