"""Every error this project raises on purpose.

ReconrosError
├── UsageError             what the user gave cannot be used: the command ends with status 2
│   ├── FileError          the same, with the file and line it stands in
│   │   └── BitstreamError a bitstream that is damaged or meant for another slot
│   └── GraphError         a computation graph that cannot be, with the place of the mistake in it
├── TransportError         the network did not do what was asked (no router, port in use, closed)
├── BadMessageError        a message that is counted and dropped; never ends a process
├── CallbackError          a callback that did what it may not; it is failed, the board goes on
│   ├── PageFaultError     it read or wrote where its memory does not reach
│   └── CallbackLimitError it did not end within its limit
└── ExperimentError        an experiment that could not be completed
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


_LONG = 600


class ReconrosError(Exception):
    """Base of all errors of this project; `str()` is one or more plain sentences for the user."""

    def __reduce__(self) -> tuple[object, ...]:
        # From another process it comes without __init__, which takes other arguments than `args`.
        return type(self).__new__, (type(self), *self.args), self.__dict__


class UsageError(ReconrosError):
    """What the user gave cannot be used; the message says what to do."""


class FileError(UsageError):
    """A file that cannot be used: `path:line: what is wrong. Remedy.`."""

    def __init__(self, path: Path | str, line: int | None, problem: str, remedy: str = "") -> None:
        if len(problem) > _LONG:  # it quotes the file, which may hold anything
            problem = f"{problem[: _LONG // 2]} ... {problem[-_LONG // 2 :]}"
        self.path = path
        self.line = line
        self.problem = problem
        self.remedy = remedy
        place = f"{path}:{line}" if line is not None else f"{path}"
        super().__init__(f"{place}: {problem}" + (f" {remedy}" if remedy else ""))


class BitstreamError(FileError):
    """A bitstream file that is damaged or belongs to another slot or callback."""


class GraphError(UsageError):
    """A computation graph that cannot be.

    `place` leads to the mistake as it would in a graph file: `("topics", "A", "publishers", 1)` is the second
    publisher of topic A.
    """

    def __init__(self, place: tuple[str | int, ...], problem: str, remedy: str) -> None:
        self.place = place
        self.problem = problem
        self.remedy = remedy
        super().__init__(f"{'.'.join(map(str, place))} {problem} {remedy}")


class TransportError(ReconrosError):
    """The network did not do what was asked of it."""


class BadMessageError(ReconrosError):
    """A message that cannot be processed.

    `reason` is a short stable word under which the board counts it: one of
    `no_attachment`, `foreign_domain`, `type_mismatch`, `truncated`, `foreign_encoding`, or a reason of the
    callback or client that refused it (`image_size`, `image_encoding`, `number_count`, `leg`, `frame_id`,
    `stamp`), `check_failed` where its check failed itself, `goal_queue` for a goal that no place is left for,
    or `fifo_size` for one that is larger than a FIFO of a hardware-mapped topic.
    """

    def __init__(self, reason: str, detail: str) -> None:
        self.reason = reason
        self.detail = detail
        super().__init__(f"{reason}: {detail}")


class CallbackError(ReconrosError):
    """A callback did what it may not: it is counted and logged as failed, its worker goes on."""


class PageFaultError(CallbackError):
    """A callback read or wrote where no memory of its own is; `address` is where it began."""

    def __init__(self, callback: str, slot: int, access: str, address: int, size: int) -> None:
        self.address = address
        super().__init__(
            f"page fault: callback {callback} in slot {slot} cannot {access} {size} bytes at {address:#x}, "
            "which do not lie in one block of its memory. Check the offset, the length and the pointer."
        )


class CallbackLimitError(CallbackError):
    """A callback did not end within its limit."""

    def __init__(self, callback: str, limit_ns: int) -> None:
        super().__init__(f"callback {callback} did not end within its limit of {limit_ns / 1e6:g} ms.")


class ExperimentError(ReconrosError):
    """An experiment that could not be completed."""
