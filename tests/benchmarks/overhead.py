"""What the board adds to a message: client -> board -> client against a raw zenoh-python ping-pong.

Both sides read every byte they get and send the same bytes; both use the same malloc settings; both echo
processes are found through the same router. The board is one with the native profile and one software worker, whose
callback gets the decoded message and publishes it. Rounds of both alternate in one run.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np
import zenoh
from table import arguments, free_port, print_result

from host_clients.image import image_message
from reconros_zenoh.clock.wall import keep_time
from reconros_zenoh.rmw.node import Context
from reconros_zenoh.ros.qos import QosProfile
from reconros_zenoh.ros.types import TypeRegistry
from reconros_zenoh.transport.memory import tune_malloc
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable

ECHO = Path(__file__).parent / "echo"
ROUNDS = 5
LIMIT_S = 20.0


def raw_session(router: str) -> zenoh.Session:
    """Return a session configured as the project's are."""
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", f'["{router}"]')
    config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def raw_echo(router: str) -> None:
    """Send every message back until stdin closes: the rival's echo process."""
    tune_malloc()
    with raw_session(router) as session:
        publisher = session.declare_publisher("raw/out", congestion_control=zenoh.CongestionControl.DROP)
        session.declare_subscriber(
            "raw/in", zenoh.handlers.Callback(lambda sample: publisher.put(sample.payload.to_bytes()), indirect=False)
        )
        print("ready", flush=True)
        sys.stdin.read()


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
        picture = rng.integers(256, size=shape, dtype=np.uint8)
        rows.append((name, "image", image_message(types, "mono8", picture), count))
    return rows


def main() -> None:
    """Run the benchmark."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--raw-echo", metavar="ROUTER", help="be the rival's echo process")
    given = parser.parse_args()
    if given.raw_echo:
        raw_echo(given.raw_echo)
        return
    keep_time()
    tune_malloc()
    router = f"tcp/127.0.0.1:{free_port()}"
    with ZenohRouter.open(router):
        board = subprocess.Popen(
            [sys.executable, "-m", "board_daemon", str(ECHO), "--profile", "native", "--mapping", "software"]
            + ["--name", "echo", "--router", router],
            stdout=subprocess.PIPE,
            text=True,
        )
        rival = subprocess.Popen(
            [sys.executable, __file__, "--raw-echo", router], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        try:
            assert board.stdout is not None
            assert rival.stdout is not None
            board.stdout.readline()
            rival.stdout.readline()
            rows = measure(router)
        finally:
            for process in (board, rival):
                process.terminate()
                process.wait()
    print_result("overhead", rows, as_json=given.json)


def measure(router: str) -> list[dict[str, Any]]:
    """Return a row per message."""
    types = TypeRegistry()
    answers: SimpleQueue[int] = SimpleQueue()
    rows = []
    with ZenohTransport.open(router) as transport, raw_session(router) as raw:
        node = Context(transport).node("overhead_client")
        publishers = {}
        for topic, type_name in (("number", "std_msgs/msg/UInt32"), ("image", "sensor_msgs/msg/Image")):
            matched = threading.Event()
            message_type = types.message(type_name)
            node.subscription(
                message_type, f"/{topic}_out", lambda _: answers.put(time.perf_counter_ns()), QosProfile()
            )
            publishers[topic] = node.publisher(
                message_type, f"/{topic}_in", on_matching=lambda yes, matched=matched: yes and matched.set()
            )
            assert matched.wait(LIMIT_S), "the board does not listen"

        def on_raw(sample: zenoh.Sample) -> None:
            sample.payload.to_bytes()
            answers.put(time.perf_counter_ns())

        raw.declare_subscriber("raw/out", zenoh.handlers.Callback(on_raw, indirect=False))
        raw_publisher = raw.declare_publisher("raw/in", congestion_control=zenoh.CongestionControl.DROP)
        for name, topic, message, count in messages(types):
            publisher = publishers[topic]
            payload = b"".join(publisher.message_type.encode(message))
            sides: dict[str, Callable[[], None]] = {
                "raw": lambda payload=payload: raw_publisher.put(payload),
                "ours": lambda publisher=publisher, message=message: publisher.publish(message),
            }
            for send in sides.values():
                ping(send, answers, 20)
            medians: dict[str, list[float]] = {side: [] for side in sides}
            for _ in range(ROUNDS):
                for side, send in sides.items():
                    medians[side].append(statistics.median(ping(send, answers, count)))
            ratios = [ours / rival for ours, rival in zip(medians["ours"], medians["raw"], strict=True)]
            rows.append(
                {
                    "message": name,
                    "bytes": len(payload),
                    "raw_us": statistics.median(medians["raw"]),
                    "ours_us": statistics.median(medians["ours"]),
                    "ratio": statistics.median(ratios),
                    "ratio_min": min(ratios),
                    "ratio_max": max(ratios),
                }
            )
    return rows


if __name__ == "__main__":
    main()
