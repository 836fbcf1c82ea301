"""A peer that has nothing of this project: a pyzeros node that asks a board for a servo index.

Run as `python pyzeros_peer.py ENDPOINT ANGLE`. It prints the answer and the nodes that it sees, and stays
until its standard input ends. The attachment is put together here, because that of pyzeros is compiled at its
first use.
"""

from __future__ import annotations

import json
import struct
import sys
import time
from queue import SimpleQueue
from threading import Event
from typing import Any

import pyzeros
import pyzeros.node
import pyzeros.sub
import zenoh
from ros2_pyterfaces.cyclone.std_msgs.msg import UInt32

LIMIT_S = 30
NODES = ("inverse_node", "mnist_node", "sobel_node", "sort_node", "hash_node")
ANY: Any = {"_zenoh_id": "*", "_node_id": "*", "_entity_id": "*"}


def open_session(endpoint: str) -> zenoh.Session:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def wait_for_token(session: zenoh.Session, key: str) -> None:
    """Return when a liveliness token of this key is there."""
    there = Event()
    watch: Any = session.liveliness().declare_subscriber(key, lambda _: there.set(), history=True)
    assert there.wait(LIMIT_S), key
    watch.undeclare()


def main(endpoint: str, angle: int) -> None:
    answers: SimpleQueue[bytes] = SimpleQueue()
    heard = Event()
    with (
        open_session(endpoint) as session,
        pyzeros.auto_context("independent_peer", zenoh_session=session, domain_id=0) as node,
    ):
        for name in NODES:
            wait_for_token(session, pyzeros.node.token_keyexpr(name, session, domain_id=0, **ANY))
        subscription = pyzeros.sub.RawSub(
            UInt32, "/legangle", lambda sample: answers.put(sample.payload.to_bytes()), session=node
        )
        publisher: Any = pyzeros.Pub(UInt32, "/angle", session=node)
        publisher.zenoh_pub.declare_matching_listener(lambda _: heard.set())
        assert publisher.zenoh_pub.matching_status.matching or heard.wait(LIMIT_S)
        attachment = struct.pack("<qqB16s", 1, time.time_ns(), 16, publisher.gid.tobytes())
        publisher.zenoh_pub.put(UInt32(data=angle).serialize(), attachment=attachment)
        answer = UInt32.deserialize(answers.get(timeout=LIMIT_S))
        print(answer.data)
        publisher.close()
        subscription.close()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
