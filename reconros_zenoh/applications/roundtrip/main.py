"""The application of Section V-C: five callbacks on one board (Listing 4, in Python)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.applications.roundtrip.callbacks.hash import Hash
from reconros_zenoh.applications.roundtrip.callbacks.inverse import Inverse
from reconros_zenoh.applications.roundtrip.callbacks.mnist import Mnist
from reconros_zenoh.applications.roundtrip.callbacks.sobel import Sobel
from reconros_zenoh.applications.roundtrip.callbacks.sort import Sort

if TYPE_CHECKING:
    from reconros_zenoh.project.application import Application


def main(app: Application) -> None:
    """Register each callback where the mapping wants it, and spin."""
    callbacks: dict[tuple[str, str], Inverse | Mnist | Sobel | Sort] = {
        ("inverse", "sub"): Inverse(app.writer("inverse", "pub")),
        ("mnist", "sub"): Mnist(app.writer("mnist", "pub")),
        ("sobel", "sub"): Sobel(app.writer("sobel", "pub")),
        ("sort", "srv"): Sort(app.types.service("sorter_msgs/srv/Sort").response),
    }
    for (name, resource), callback in callbacks.items():
        app.register(
            name, resource, software=callback.software, hardware=callback.hardware, check=callback.check
        )
    digests = Hash(app.writer("hash", "pub"), app.types.message("std_msgs/msg/MultiArrayLayout"))
    app.register("hash", "tmr", software=digests.software, hardware=digests.hardware)
    app.spin()
