"""Traces of boards as files: for Perfetto, or drawn."""

from __future__ import annotations

import json
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.file_lock import lock
from reconros_zenoh.measure.plots import write_figure
from reconros_zenoh.measure.trace_plots import trace_figure

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from reconros_zenoh.board.board import Board
    from reconros_zenoh.board.trace import Trace

_DRAWINGS = ("png", "svg")


@contextmanager
def traced_to(path: Path | None, board: Board) -> Iterator[None]:
    """Run the block, then write what the board did when, however it ended; None: to no file.

    Raise UsageError, before the block if possible, when the file cannot be written.
    """
    if path is None or board.trace is None:
        yield
        return
    with own_trace_file(path):
        try:
            yield
        finally:
            write_trace(path, board.name, board.trace)


@contextmanager
def own_trace_file(path: Path) -> Iterator[None]:
    """Run the block with a file to which no other board writes its trace.

    Makes its folder; raises UsageError when the file cannot be written, or while another board has it.
    """
    if path.suffix.lower() not in {".json", *(f".{each}" for each in _DRAWINGS)}:
        raise UsageError(
            f"{path}: a trace is written as .json, for ui.perfetto.dev, or drawn as .png or .svg. "
            "Name the file *.json."
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("ab")
    except OSError as error:
        raise _unwritable(path, error) from None
    with file:
        if not lock(file.fileno()):
            raise UsageError(f"another board writes its trace to {path}. Give each a --trace of its own.")
        yield


def write_trace(path: Path, board: str, trace: Trace) -> None:
    """Write what the board of this name did: all of it, or drawn the last second.

    Raise UsageError if the file cannot be written.
    """
    if path.suffix.lower() == ".json":
        try:
            path.write_text(json.dumps(trace_events(board, trace)), encoding="utf-8")
        except OSError as error:
            raise _unwritable(path, error) from None
    else:
        write_figure(trace_figure(board, trace), path, _DRAWINGS)


def trace_events(board: str, trace: Trace) -> dict[str, Any]:
    """Return the trace in the Trace Event Format (Google), which Perfetto and Chrome read; times in us.

    The board is a process, its tracks are threads, the stages of a call are slices within its slice.
    """
    numbers = {track.name: number for number, track in enumerate(trace.tracks)}
    events: list[dict[str, Any]] = [{"ph": "M", "pid": 0, "name": "process_name", "args": {"name": board}}]
    for name, number in numbers.items():
        of_track = {"ph": "M", "pid": 0, "tid": number}
        events.append({**of_track, "name": "thread_name", "args": {"name": name}})
        events.append({**of_track, "name": "thread_sort_index", "args": {"sort_index": number}})
    # Of two that begin together the longer one holds the other.
    slices = sorted(trace.slices(), key=lambda each: (each.begin_ns, -each.end_ns, each.stage is not None))
    events += [
        {
            "ph": "X",
            "pid": 0,
            "tid": numbers[each.track],
            "ts": each.begin_ns / 1e3,
            "dur": (each.end_ns - each.begin_ns) / 1e3,
            "name": each.stage or each.name,
            "cat": "stage" if each.stage else "call",
        }
        for each in slices
    ]
    return {"traceEvents": events, "displayTimeUnit": "ms"}


def _unwritable(path: Path, error: OSError) -> UsageError:
    return UsageError(f"{path} cannot be written ({error.strerror}). Choose another file for --trace.")
