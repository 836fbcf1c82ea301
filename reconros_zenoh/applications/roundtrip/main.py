"""The application of Section V-C: five callbacks on one board (Listing 4, in Python)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.applications.roundtrip.callbacks.hash import Hash
from reconros_zenoh.applications.roundtrip.callbacks.inverse import Inverse
from reconros_zenoh.applications.roundtrip.callbacks.mnist import Mnist
from reconros_zenoh.applications.roundtrip.callbacks.sobel import Sobel
from reconros_zenoh.applications.roundtrip.callbacks.sort import Sort
from reconros_zenoh.board.executor import Executor
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from reconros_zenoh.project.application import Application


def main(app: Application) -> None:
    """Register each callback where the mapping wants it, and spin."""
    mapping = app.mapping
    executor = Executor(
        app.board, mapping.software_workers, mapping.hardware_workers, app.bitstreams, mapping.executor
    )
    callbacks: dict[str, tuple[CallbackKind, str, Inverse | Mnist | Sobel | Sort | Hash]] = {
        "inverse": (CallbackKind.SUB, "sub", Inverse(app.writer("inverse", "pub"))),
        "mnist": (CallbackKind.SUB, "sub", Mnist(app.writer("mnist", "pub"))),
        "sobel": (CallbackKind.SUB, "sub", Sobel(app.writer("sobel", "pub"))),
        "sort": (CallbackKind.SRV, "srv", Sort(app.types.service("sorter_msgs/srv/Sort").response)),
        "hash": (
            CallbackKind.TMR,
            "tmr",
            Hash(app.writer("hash", "pub"), app.types.message("std_msgs/msg/MultiArrayLayout")),
        ),
    }
    for name, (kind, resource, callback) in callbacks.items():
        source = app.source(name, resource)
        place = mapping.callbacks[name]
        if place.software:
            executor.add_sw_callback(name, kind, source, callback.software, callback.check)
        if place.slots:
            executor.add_hw_callback(name, place.slots, kind, source, callback.hardware, callback.check)
    app.spin(executor)
