"""ReconROS without the board: ROS 2 callbacks on emulated CPU+FPGA boards over Zenoh.

What a project or a notebook needs stands here; each name is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from reconros_zenoh.executor.callbacks import CallbackKind

if TYPE_CHECKING:
    from reconros_zenoh.board.callback import HardwareThread
    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.kernel import Kernel
    from reconros_zenoh.board.software import SoftwareContext
    from reconros_zenoh.board.timing import Cycles, Native
    from reconros_zenoh.errors import BadMessageError, ReconrosError, UsageError
    from reconros_zenoh.measure.notebook import histogram
    from reconros_zenoh.project.application import Application
    from reconros_zenoh.rmw.action_client import ActionEvent
    from reconros_zenoh.rmw.action_server import GoalHandle, GoalStatus
    from reconros_zenoh.ros.qos import Durability, History, QosProfile, Reliability
    from reconros_zenoh.virtual_board import VirtualBoard, VirtualProject

__all__ = [
    "CLT",
    "SRV",
    "SUB",
    "TMR",
    "ActionEvent",
    "Application",
    "BadMessageError",
    "Cycles",
    "Durability",
    "Executor",
    "GoalHandle",
    "GoalStatus",
    "HardwareThread",
    "History",
    "Kernel",
    "Native",
    "QosProfile",
    "ReconrosError",
    "Reliability",
    "SoftwareContext",
    "UsageError",
    "VirtualBoard",
    "VirtualProject",
    "histogram",
]

TMR, SUB, SRV, CLT = CallbackKind
"""The primitives that make a callback ready: ReconROS_TMR, ReconROS_SUB, ReconROS_SRV, ReconROS_CLT."""

_PLACES = {
    "board.callback": ("HardwareThread",),
    "board.executor": ("Executor",),
    "board.kernel": ("Kernel",),
    "board.software": ("SoftwareContext",),
    "board.timing": ("Cycles", "Native"),
    "errors": ("BadMessageError", "ReconrosError", "UsageError"),
    "measure.notebook": ("histogram",),
    "project.application": ("Application",),
    "rmw.action_client": ("ActionEvent",),
    "rmw.action_server": ("GoalHandle", "GoalStatus"),
    "ros.qos": ("Durability", "History", "QosProfile", "Reliability"),
    "virtual_board": ("VirtualBoard", "VirtualProject"),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for first: the whole would take a second."""
    for place, names in _PLACES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{place}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
