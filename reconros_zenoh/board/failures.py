"""What is told of failures, and that each is told once."""

from __future__ import annotations


class Failures:
    """The ways in which something has failed so far: a type of error, raised at a place in the code."""

    def __init__(self) -> None:
        self._known: set[tuple[type[BaseException], str, int]] = set()

    def is_new(self, error: BaseException) -> bool:
        """Tell whether nothing has failed in this way before, and know it from now on."""
        file, line = "", 0
        trace = error.__traceback__
        while trace is not None:
            file, line = trace.tb_frame.f_code.co_filename, trace.tb_lineno
            trace = trace.tb_next
        way = type(error), file, line
        is_new = way not in self._known
        self._known.add(way)
        return is_new


def text_of(error: BaseException) -> str:
    """Return what the error says; one of a callback may fail at that, too."""
    try:
        return str(error)
    except Exception:  # noqa: BLE001 - whatever its `__str__` raises
        return "it cannot say why"
