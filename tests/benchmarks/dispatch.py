"""How fast a ready callback starts, in the native profile, with 1, 10 and 100 callbacks registered.

Goal: at most 60 us from ready to the first line of the callback (median), and flat in the number of callbacks
(within 1.5 times). The callback that becomes ready is another one each time, and the board is idle before.
Below it how many empty callbacks a second one worker gets through, beside a bare thread pool of one thread
whose submits are all made at once.
"""

from __future__ import annotations

import statistics
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from table import arguments, print_result

from reconros_zenoh.board.board import Board
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.sources import Event, Source
from reconros_zenoh.board.spans import Timeline
from reconros_zenoh.clock.process import tune_process
from reconros_zenoh.clock.virtual import succeed_once
from reconros_zenoh.clock.wall import WallEnvironment
from reconros_zenoh.executor.callbacks import CallbackKind
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.transport.simulated import SimulatedNetwork

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.board.software import SoftwareContext

COUNTS = (1, 10, 100)
GOAL_US = 60
FLAT = 1.5
LIMIT_S = 60.0


class Bell(Source):
    """A source that becomes ready when it is rung."""

    def __init__(self, environment: WallEnvironment) -> None:
        super().__init__()
        self._environment = environment
        self._rings = 0

    def ring(self, times: int = 1) -> int:
        """Become ready and return when that was [ns]; called by the event loop."""
        ready_ns = time.perf_counter_ns()
        self._rings += times
        self._on_ready()
        return ready_ns

    def is_ready(self) -> bool:
        """Tell whether somebody has rung."""
        return self._rings > 0

    def take(self) -> Event:
        """Take one ring."""
        self._rings -= 1
        return Event(None, Timeline(self._environment, self._environment.now))


class BusyBoard:
    """A native board with so many callbacks, whose event loop runs in a thread of its own."""

    def __init__(self, callbacks: int) -> None:
        self.environment = WallEnvironment()
        context = Context(SimulatedNetwork(self.environment).transport("b0"))
        self._board = Board(self.environment, context, read_profile("native"), (), threads=1)
        executor = Executor(self._board, 1, 0)
        self.bells = [Bell(self.environment) for _ in range(callbacks)]
        self.started_ns = 0
        self.calls = 0
        self.awaited = 0
        self.done = threading.Event()
        for number, bell in enumerate(self.bells):
            executor.add_sw_callback(f"callback{number}", CallbackKind.SUB, bell, self._callback)
        executor.spin()
        self._stop = self.environment.event()
        self._loop = threading.Thread(target=self.environment.run, args=(self._stop,))
        self._loop.start()

    def close(self) -> None:
        """End the event loop."""
        self.environment.post(succeed_once, self._stop)
        self._loop.join()
        self._board.close()

    def _callback(self, _: None, __: SoftwareContext) -> None:
        self.started_ns = time.perf_counter_ns()
        self.calls += 1
        if self.calls == self.awaited:
            self.done.set()

    def wait_for(self, calls: int, ring: Callable[[], None]) -> None:
        """Ring, and return when so many more calls were made."""
        self.done.clear()
        self.awaited = self.calls + calls
        self.environment.post(ring)
        assert self.done.wait(LIMIT_S), "the board does not answer"


def ready_to_start_us(callbacks: int, count: int) -> list[float]:
    """Return the times [us] from ready to the first line of the callback."""
    board = BusyBoard(callbacks)
    times = []
    ready: list[int] = []
    for number in range(-count // 10, count):
        bell = board.bells[number % callbacks]
        board.wait_for(1, lambda bell=bell: ready.append(bell.ring()))  # type: ignore[misc]
        if number >= 0:  # before that the host learns how long the callback takes
            times.append((board.started_ns - ready[-1]) / 1e3)
    board.close()
    return times


def callbacks_per_second(count: int) -> float:
    """Return how many empty callbacks a worker calls per second."""
    board = BusyBoard(1)
    board.wait_for(count // 10, lambda: board.bells[0].ring(count // 10) and None)
    started = time.perf_counter()
    board.wait_for(count, lambda: board.bells[0].ring(count) and None)
    took = time.perf_counter() - started
    board.close()
    return count / took


def submits_per_second(count: int) -> float:
    """Return how many empty functions a bare thread pool calls per second."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(int).result()
        started = time.perf_counter()
        futures = [pool.submit(int) for _ in range(count)]
        futures[-1].result()
        return count / (time.perf_counter() - started)


def main() -> None:
    """Run the benchmark."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--count", type=int, default=3000, help="callbacks per row")
    given = parser.parse_args()
    tune_process()
    rows: list[dict[str, Any]] = []
    for callbacks in COUNTS:
        times_us = ready_to_start_us(callbacks, given.count)
        median_us = statistics.median(times_us)
        alone_us = rows[0]["median_us"] if rows else median_us
        rows.append(
            {
                "callbacks": callbacks,
                "median_us": median_us,
                "p99_us": statistics.quantiles(times_us, n=100)[98],
                "ratio_to_one": median_us / alone_us,
                "reached": median_us <= GOAL_US and median_us <= FLAT * alone_us,
            }
        )
    ours, bare = callbacks_per_second(10 * given.count), submits_per_second(10 * given.count)
    throughput = {"ours_per_s": ours, "bare_per_s": bare, "ratio": ours / bare}
    if given.json:
        print_result("dispatch", [row | throughput for row in rows], as_json=True)
        return
    print_result("dispatch", rows, as_json=False)
    print_result("empty callbacks", [throughput], as_json=False)


if __name__ == "__main__":
    main()
