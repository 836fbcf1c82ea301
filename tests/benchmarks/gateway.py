"""What a gateway is worth on this host: SMT, gateway and raw Zenoh, message by message in the same run.

The first two are `reconros experiment gateway --profile native`. The rival has one publisher, one process
with a raw subscription for each hardware node and one with the software subscriber's; every subscription
copies the payload. Whoever comes last counts; every body is checked.
"""

from __future__ import annotations

import struct
import time
import zlib
from contextlib import ExitStack
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import zenoh
from overhead import raw_session
from table import arguments, print_result

from reconros_zenoh.applications.gateway.nodes import random_body
from reconros_zenoh.clock.process import tune_process
from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.experiments.gateway import COUNTS, SIZES
from reconros_zenoh.experiments.gateway_native import Setup, copies, native_setup, take_turns
from reconros_zenoh.experiments.gateway_processes import Receiver
from reconros_zenoh.experiments.processes import Processes, commands
from reconros_zenoh.transport.zenoh import ZenohRouter

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

HEADER = struct.Struct("<qqI")  # number, time of publication [ns], CRC-32
KEY = "raw/a"


def raw_subscribers(connection: Connection, router: str, names: list[str]) -> None:
    """Receive with one subscription per name, each of which copies the payload."""
    tune_process()
    receiver = Receiver(connection, len(names))

    def on_sample(name: str, sample: zenoh.Sample) -> None:
        payload = sample.payload.to_bytes()
        number, sent_ns, crc = HEADER.unpack_from(payload)
        seconds, nanoseconds = divmod(sent_ns, 1_000_000_000)
        stamp = SimpleNamespace(sec=seconds, nanosec=nanoseconds)
        header = SimpleNamespace(stamp=stamp, frame_id=f"{number} {crc:08x}")
        receiver.note(name, SimpleNamespace(header=header, data=memoryview(payload)[HEADER.size :]))

    with raw_session(router) as session:
        for name in names:
            session.declare_subscriber(KEY, zenoh.handlers.Callback(partial(on_sample, name), indirect=False))
        connection.send("ready")
        for _ in commands(connection):
            receiver.check()


def raw_publisher(connection: Connection, router: str, size: int) -> None:
    """Publish the message whose number is asked for."""
    tune_process()
    body = random_body(size).tobytes()
    crc = zlib.crc32(body)
    with raw_session(router) as session:
        publisher = session.declare_publisher(KEY, congestion_control=zenoh.CongestionControl.DROP)
        for number in commands(connection):
            publisher.put(HEADER.pack(number, time.monotonic_ns(), crc) + body)


def raw_setup(processes: Processes, router: str, size: int, count: int) -> Setup:
    """Return the rival."""
    names = [f"hardware_{index}" for index in range(count)]
    return Setup(
        processes,
        [(raw_subscribers, (router, names)), (raw_subscribers, (router, ["software"]))],
        (raw_publisher, (router, size)),
    )


def measure(routers: list[str], size: int, count: int, repeat: int) -> dict[str, Any]:
    """Return one row."""

    def begin(processes: Processes) -> dict[str, Setup]:
        return {
            "raw": raw_setup(processes, routers[0], size, count),
            "smt": native_setup(processes, routers[1], "smt", size, count),
            "gateway": native_setup(processes, routers[2], "bridged", size, count),
        }

    times = take_turns(begin, repeat)
    return {
        "kB": size / 1000,
        "subscribers": count,
        **{f"{name}_hw_ms": each.hw_max_ms for name, each in times.items()},
        "speedup_hw": times["smt"].hw_max_ms / times["gateway"].hw_max_ms,
        "raw_over_gateway": times["raw"].hw_max_ms / times["gateway"].hw_max_ms,
        **{f"{name}_sw_ms": each.sw_ms for name, each in times.items()},
        "lost": sum(each.lost for each in times.values()),
        "speedup_sw": times["smt"].sw_ms / times["gateway"].sw_ms,
    }


def main() -> None:
    """Print the table."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--repeat", type=int, default=40, help="messages per cell and rival")
    parser.add_argument("--sizes", nargs="+", type=int, default=list(SIZES.values()), help="bytes")
    parser.add_argument("--subscribers", nargs="+", type=int, default=list(COUNTS))
    chosen = parser.parse_args()
    routers = [free_endpoint() for _ in range(3)]
    with ExitStack() as networks:
        for router in routers:
            networks.enter_context(ZenohRouter.open(router))
        rows = [
            measure(routers, size, count, chosen.repeat)
            for size in chosen.sizes
            for count in chosen.subscribers
        ]
    print_result("gateway", rows, as_json=chosen.json)
    if not chosen.json:
        print("\n".join(copies()))


if __name__ == "__main__":
    main()
