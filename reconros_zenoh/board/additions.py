"""What a callback is added with: a mistake is told there, not when the callback first runs, or never does."""

from __future__ import annotations

from reconros_zenoh.board.kernel import Kernel
from reconros_zenoh.board.sources import Source
from reconros_zenoh.board.timing import Cycles, Native
from reconros_zenoh.errors import UsageError
from reconros_zenoh.executor.callbacks import CallbackKind


def check_addition(
    name: str, kind: object, source: object, function: object, check: object, timing: object
) -> None:
    """Raise UsageError unless a callback can be added with these."""
    if not callable(function):
        raise UsageError(f"callback {name!r} is {function!r}, which cannot be called. Give a function.")
    if not isinstance(kind, CallbackKind):
        raise UsageError(f"callback {name!r} is of the kind {kind!r}. Give rz.TMR, rz.SUB, rz.SRV or rz.CLT.")
    if not isinstance(source, Source):
        raise UsageError(
            f"callback {name!r} has the source {source!r}. Give a timer, subscription, service, action or "
            "client, as the board or app.source returns it."
        )
    if source.kind not in {None, kind}:
        assert source.kind is not None
        raise UsageError(
            f"callback {name!r} is of the kind {kind.name}, and its source, a {type(source).__name__}, of "
            f"the kind {source.kind.name}. Give rz.{source.kind.name}, or another source."
        )
    if check is not None and not source.checks:
        raise UsageError(
            f"callback {name!r} has a check, and its source, a {type(source).__name__}, no messages that "
            "could be checked. Leave out `check`."
        )
    check_timing(name, timing)
    if isinstance(function, Kernel):
        _check_kernel(name, kind, source, function)


def check_timing(name: str, timing: object) -> None:
    """Raise UsageError unless a callback can be said to take this long; None says nothing."""
    if not isinstance(timing, Cycles | Native | None):
        raise UsageError(f"timing={timing!r} of callback {name!r}: write Cycles(n) or Native(factor).")


def _check_kernel(name: str, kind: CallbackKind, source: Source, kernel: Kernel) -> None:
    if kind is CallbackKind.SRV and kernel.publish is not None:
        raise UsageError(
            f"the kernel of callback {name!r} publishes, so its request has no response. Leave out `publish`."
        )
    if kind is not CallbackKind.SRV and kernel.publish is None:
        raise UsageError(
            f"the kernel of callback {name!r} answers, but nobody has asked. Say with `publish` where to."
        )
    for path in kernel.reads:
        if source.message_type is None:
            raise UsageError(
                f"the kernel of callback {name!r} reads {path!r}, but no message starts it: write reads=()."
            )
        source.message_type.form(path)
