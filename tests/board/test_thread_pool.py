"""The pool in which callbacks compute: as futures have it, and nobody waits for ever at its end."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import CancelledError

import pytest

from reconros_zenoh.board import thread_pool
from reconros_zenoh.board.thread_pool import ThreadPool


def test_results_and_errors_come_as_futures() -> None:
    pool = ThreadPool(2, "test")
    assert [pool.submit(divmod, 7, n).result(10) for n in (2, 3)] == [(3, 1), (2, 1)]
    with pytest.raises(ZeroDivisionError):
        pool.submit(divmod, 1, 0).result(10)
    with pytest.raises(SystemExit):
        pool.submit(exit, 1).result(10)
    assert pool.submit(divmod, 7, 4).result(10) == (1, 3)
    pool.close()


def test_what_never_ends_is_left_and_what_has_not_begun_never_does(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(thread_pool, "_LAST_S", 0.0)
    pool, begun, end = ThreadPool(1, "test"), threading.Event(), threading.Event()

    def endless() -> None:
        begun.set()
        end.wait()

    running, waiting = pool.submit(endless), pool.submit(int)
    assert begun.wait(30)
    pool.close()
    assert "1 computations have not ended" in caplog.text
    with pytest.raises(CancelledError):
        waiting.result(0)
    end.set()
    assert running.result(10) is None


def test_a_computation_that_never_ends_does_not_keep_the_process_alive() -> None:
    program = (
        "import threading\n"
        "from reconros_zenoh.board.thread_pool import ThreadPool\n"
        "begun = threading.Event()\n"
        "ThreadPool(1, 'test').submit(lambda: (begun.set(), threading.Event().wait()))\n"
        "assert begun.wait(30)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
