"""What the board adds to a message: client -> board -> client against a raw zenoh-python ping-pong.

Both sides read every byte they get and send as many; both use the same malloc settings; both find each other
through the same router, and rounds of both alternate in one run. The rival has Zenoh's own defaults; our
processes have what our transport sets for every process, its thread pools included (transport/zenoh.py). The
board has the native profile and one software worker, whose callback gets the decoded message and publishes
it.
"""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np
import zenoh
from table import arguments, print_result

from reconros_zenoh.clock.process import tune_memory, tune_process
from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.image import image_message
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ECHO = Path(__file__).parent / "echo"
ROUNDS = 5
LIMIT_S = 20.0


def raw_session(router: str) -> zenoh.Session:
    """Return a session that finds its peers as the project's do, everything else as zenoh has it."""
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", f'["{router}"]')
    config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def raw_echo(router: str) -> None:
    """Send every message back until stdin closes: the rival's echo process."""
    tune_memory()
    with raw_session(router) as session:
        publisher = session.declare_publisher("raw/out", congestion_control=zenoh.CongestionControl.DROP)

        def on_sample(sample: zenoh.Sample) -> None:
            publisher.put(sample.payload.to_bytes())

        session.declare_subscriber("raw/in", zenoh.handlers.Callback(on_sample, indirect=False))
        print("ready", flush=True)
        sys.stdin.read()


def raw_client(router: str) -> None:
    """For each line `bytes count` on stdin print the median round trip [us]: the rival's client process."""
    tune_process()
    answers: SimpleQueue[int] = SimpleQueue()

    def on_sample(sample: zenoh.Sample) -> None:
        sample.payload.to_bytes()
        answers.put(time.perf_counter_ns())

    with raw_session(router) as session:
        session.declare_subscriber("raw/out", zenoh.handlers.Callback(on_sample, indirect=False))
        publisher = session.declare_publisher("raw/in", congestion_control=zenoh.CongestionControl.DROP)
        while not publisher.matching_status.matching:
            time.sleep(0.01)
        print("ready", flush=True)
        for line in sys.stdin:
            size, count = map(int, line.split())
            payload = os.urandom(size)
            times = ping(lambda payload=payload: publisher.put(payload), answers, count)
            print(statistics.median(times), flush=True)


def ping(send: Callable[[], None], answers: SimpleQueue[int], count: int) -> list[float]:
    """Return the times [us] of `count` round trips."""
    times = []
    for _ in range(count):
        started_ns = time.perf_counter_ns()
        send()
        times.append((answers.get(timeout=LIMIT_S) - started_ns) / 1e3)
    return times


def messages(types: TypeRegistry) -> list[tuple[str, str, Any, int]]:
    """Return name, topic, message and number of round trips per round of each size."""
    uint32 = types.message("std_msgs/msg/UInt32").cls(data=7)
    rng = np.random.default_rng(0)
    sizes = {"Image 8 KiB": (64, 128), "Image 900 KiB": (480, 1920), "Image 6 MiB": (1080, 5760)}
    rows: list[tuple[str, str, Any, int]] = [("UInt32", "number", uint32, 1000)]
    for (name, shape), count in zip(sizes.items(), (1000, 200, 60), strict=True):
        picture = np.frombuffer(rng.bytes(math.prod(shape)), np.uint8).reshape(shape)
        rows.append((name, "image", image_message(types, "mono8", picture), count))
    return rows


def main() -> None:
    """Run the benchmark."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--raw-echo", metavar="ROUTER", help="be the rival's echo process")
    parser.add_argument("--raw-client", metavar="ROUTER", help="be the rival's client process")
    given = parser.parse_args()
    if given.raw_echo:
        raw_echo(given.raw_echo)
    elif given.raw_client:
        raw_client(given.raw_client)
    else:
        print_result("overhead", run(), as_json=given.json)


def run() -> list[dict[str, Any]]:
    """Start the processes of both sides and return a row per message."""
    tune_process()
    router = free_endpoint()
    board = ["-m", "board_daemon", str(ECHO), "--profile=native", "--mapping=software", "--name=echo"]
    with ExitStack() as stack:
        stack.enter_context(ZenohRouter.open(router))
        stack.enter_context(child([*board, "--router", router]))
        stack.enter_context(child([__file__, "--raw-echo", router]))
        rival = stack.enter_context(child([__file__, "--raw-client", router]))
        return measure(router, rival)


@contextmanager
def child(words: list[str]) -> Iterator[subprocess.Popen[str]]:
    """Run a Python process that says when it is ready, and end it at the end."""
    process = subprocess.Popen(
        [sys.executable, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline(), f"{words} did not start"
        yield process
    finally:
        process.terminate()
        process.wait()


def measure(router: str, rival: subprocess.Popen[str]) -> list[dict[str, Any]]:
    """Return a row per message; rounds of both sides alternate."""
    assert rival.stdin is not None
    assert rival.stdout is not None
    types = TypeRegistry()
    answers: SimpleQueue[int] = SimpleQueue()
    rows = []
    with ZenohTransport.open(router) as transport:
        node = Context(transport).node("overhead_client")
        publishers = {}
        for topic, type_name in (("number", "std_msgs/msg/UInt32"), ("image", "sensor_msgs/msg/Image")):
            matched = threading.Event()
            message_type = types.message(type_name)
            node.subscription(message_type, f"/{topic}_out", lambda _: answers.put(time.perf_counter_ns()))
            publishers[topic] = node.publisher(
                message_type, f"/{topic}_in", on_matching=lambda yes, matched=matched: yes and matched.set()
            )
            assert matched.wait(LIMIT_S), "the board does not listen"
        for name, topic, message, count in messages(types):
            publisher = publishers[topic]
            size = sum(map(len, publisher.message_type.encode(message)))
            raw_us, ours_us = [], []
            for times in [20] + [count] * ROUNDS:
                rival.stdin.write(f"{size} {times}\n")
                rival.stdin.flush()
                raw_us.append(float(rival.stdout.readline()))
                send = partial(publisher.publish, message)
                ours_us.append(statistics.median(ping(send, answers, times)))
            # The first round only warms up.
            ratios = [ours / raw for ours, raw in zip(ours_us[1:], raw_us[1:], strict=True)]
            rows.append(
                {
                    "message": name,
                    "bytes": size,
                    "raw_us": statistics.median(raw_us[1:]),
                    "ours_us": statistics.median(ours_us[1:]),
                    "ratio": statistics.median(ratios),
                    "ratio_min": min(ratios),
                    "ratio_max": max(ratios),
                }
            )
    return rows


if __name__ == "__main__":
    main()
