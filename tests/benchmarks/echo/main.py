"""A board that sends every message back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from reconros_zenoh.board.executor import Executor
from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from reconros_zenoh.board.software import SoftwareCallback, SoftwareContext
    from reconros_zenoh.board.writers import TopicWriter
    from reconros_zenoh.project.application import Application


def main(app: Application) -> None:
    """Register one echo per group, and spin."""
    executor = Executor(app.board, app.mapping.software_workers, app.mapping.hardware_workers)
    for name in ("number", "image"):
        executor.add_sw_callback(
            name, CallbackKind.SUB, app.source(name, "sub"), echo_to(app.writer(name, "pub"))
        )
    app.spin(executor)


def echo_to(writer: TopicWriter) -> SoftwareCallback:
    """Return a callback that publishes what it gets."""

    def echo(message: Any, context: SoftwareContext) -> None:
        context.publish(writer, message)

    return echo
