"""Calls of a hardware callback that lack their `yield from`, which Python takes without a word."""

from __future__ import annotations

import sys
import weakref
from functools import wraps
from inspect import GEN_CREATED, getgeneratorstate
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

from reconros_zenoh.errors import CallbackError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator
    from types import CodeType

    from reconros_zenoh.clock.activity import Awaitable

Steps = TypeVar("Steps", bound="Callable[..., Generator[Awaitable, Any, Any]]")

_Call: TypeAlias = "tuple[Any, CodeType, int]"
"""The generator that a call has returned, and where it was called: the code, and the instruction in it."""


class NotedCalls:
    """Notes the steps that its calls return until somebody goes through them: base of `DelegateCalls`.

    Steps that somebody still holds may begin later, those that nobody holds never will.
    """

    def __init__(self) -> None:
        self._last_call = _NONE
        self._held: list[_Call] = []

    def not_begun(self) -> str | None:
        """Say which call nobody has gone through; None when there is none, as it should be at the end."""
        return next((_told(call) for call in (*self._held, self._last_call) if not _has_begun(call)), None)

    def _look_back(self) -> None:
        """Raise CallbackError if nobody can go through the last call any more, else keep it in mind."""
        self._held = [call for call in self._held if not _has_begun(call)]
        last, self._last_call = self._last_call, _NONE
        if _has_begun(last):
            return
        text, reference, code, instruction = _told(last), weakref.ref(last[0]), *last[1:]
        del last
        steps = reference()
        if steps is None:
            raise CallbackError(text)
        self._held.append((steps, code, instruction))


def noted(call: Steps) -> Steps:
    """Have a call noted, which raises CallbackError if the one before lacks its `yield from`."""

    @wraps(call)
    def noting(self: NotedCalls, *args: Any, **kwargs: Any) -> Any:
        if self._last_call[0].gi_frame is not None:  # it has not ended
            self._look_back()
        steps = call(self, *args, **kwargs)
        frame = sys._getframe(1)  # noqa: SLF001 - inspect takes twice as long
        # The frame itself would keep what the callback holds.
        self._last_call = steps, frame.f_code, frame.f_lasti
        return steps

    return cast("Steps", noting)


def _has_begun(call: _Call) -> bool:
    return getgeneratorstate(call[0]) != GEN_CREATED


def _told(call: _Call) -> str:
    steps, code, instruction = call
    line = next(line for start, end, line in code.co_lines() if start <= instruction < end)
    return (
        f"{steps.gi_code.co_name}() in {code.co_filename}:{line} has done nothing. "
        "Write `yield from` before it."
    )


def _nothing() -> Generator[Any, Any, None]:
    yield from ()


_ENDED = _nothing()
next(_ENDED, None)
_NONE: _Call = _ENDED, _nothing.__code__, 0
