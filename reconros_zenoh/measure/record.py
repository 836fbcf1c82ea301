"""The round trips of one client, on disk and in memory."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Self, get_args

import numpy as np
import numpy.typing as npt

from reconros_zenoh.errors import ExperimentError, FileError, UsageError
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

Outcome = Literal["ok", "wrong", "lost"]

_LIMIT_BYTES = 100_000_000
"""Some millions of round trips."""

HEADER = "index,round_trip_ms,outcome"


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """One request and what became of it.

    `time_ns` is the time from request to answer, None if and only if the request was lost. `wrong` means
    that an answer came but its content was not the right one.
    """

    index: int
    time_ns: int | None
    outcome: Outcome


@dataclass(frozen=True, eq=False)
class Record:
    """All round trips of one client under one mapping.

    `values_ms` holds the times of the ok and the wrong answers in the order of the requests (float64, shape
    `(n,)`), `lost` and `wrong` count requests. Lost requests have no value.
    """

    name: str
    values_ms: npt.NDArray[np.float64]
    lost: int = 0
    wrong: int = 0

    @classmethod
    def of(cls, name: str, round_trips: Sequence[RoundTrip]) -> Self:
        """Return the record of these round trips."""
        times_ns = [trip.time_ns for trip in round_trips if trip.time_ns is not None]
        return cls(
            name,
            np.array(times_ns, dtype=np.float64) / 1e6,
            lost=len(round_trips) - len(times_ns),
            wrong=sum(trip.outcome == "wrong" for trip in round_trips),
        )


class RecordWriter:
    """A record file that grows by one line per round trip; each line is on disk before `write` returns.

    So a run that is interrupted keeps everything it measured. Missing folders are created and an older record
    is replaced. Raises UsageError if the file cannot be created, ExperimentError if a line cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise UsageError(
                f"{path}: the record cannot be created: {error.strerror}. "
                "Choose an output folder that you may write to."
            ) from error
        try:
            self._append(HEADER)
        except ExperimentError:
            self._file.close()
            raise

    def write(self, round_trip: RoundTrip) -> None:
        """Append the round trip as one line, in milliseconds with all its nanoseconds."""
        time_ns = round_trip.time_ns
        milliseconds = "" if time_ns is None else f"{time_ns / 1e6:.6f}"
        self._append(f"{round_trip.index},{milliseconds},{round_trip.outcome}")

    def close(self) -> None:
        """Close the file; closing twice does no harm."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _append(self, line: str) -> None:
        data = f"{line}\n".encode("ascii")
        try:
            written = self._file.write(data)
        except OSError as error:
            raise self._failure(str(error.strerror)) from error
        if written < len(data):
            self._file.truncate(self._file.tell() - written)  # half a line would make the record unreadable
            raise self._failure("the disk is full")

    def _failure(self, reason: str) -> ExperimentError:
        return ExperimentError(
            f"{self._path}: a round trip could not be recorded: {reason}. "
            "Make room on the disk and run the experiment again."
        )


def read_record(path: Path) -> Record:
    """Return the record in a file, named after the file's stem.

    Reads the files of RecordWriter and any file of times in ms that are separated by `;`, `,` or line breaks,
    with an optional header word, as the authors of the paper logged them (`Periodic;`, `692.845;`, ...). All
    values of such a file are kept, warm-up and totals too; `nan` is a lost request. Raises FileError, with
    the line, for anything else; what begins with a digit, as `692ms`, is no header but a mistake.
    """
    lines = read_text_file(path, "Give a file of round-trip times in ms.", _LIMIT_BYTES).split("\n")
    if lines[0].strip() == HEADER:
        return _read_round_trips(path, lines)
    return _read_values(path, lines)


def find_records(folder: Path) -> list[Path]:
    """Return the paths of all `*.csv` files below a folder, sorted.

    Raises UsageError if there is none.
    """
    paths = sorted(path for path in folder.rglob("*.csv") if path.is_file())
    if not paths:
        raise UsageError(
            f"{folder}: no record found. Records are files named *.csv; "
            "give a folder that an experiment wrote, or a file."
        )
    return paths


def short_names(paths: Sequence[Path]) -> list[str]:
    """Return `mapping/client` for each record file, with as many folders before it as tell them apart.

    What is not UTF-8 in a path is written out, so that the names can be drawn.
    """
    parts = [path.absolute().with_suffix("").parts for path in paths]
    for depth in range(2, max(map(len, parts)) + 1):
        names = ["/".join(part[-depth:]).encode(errors="backslashreplace").decode() for part in parts]
        if len(set(names)) == len(names):
            return names
    return [str(path) for path in paths]


def _read_round_trips(path: Path, lines: list[str]) -> Record:
    values: list[float] = []
    count = dict.fromkeys(get_args(Outcome), 0)
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        fields = [field.strip() for field in line.split(",")]
        if len(fields) != 3 or not fields[0].isdecimal() or fields[2] not in count:
            raise FileError(
                path,
                number,
                f"{line.strip()!r} is not a round trip.",
                f"Lines read {HEADER}, outcome being ok, wrong or lost; remove a line that was cut short.",
            )
        _, milliseconds, outcome = fields
        if (outcome == "lost") != (milliseconds == ""):
            problem = (
                "a lost request has a time."
                if milliseconds
                else f"the time of an {outcome!r} answer is missing."
            )
            raise FileError(path, number, problem, "Only lost requests have an empty round_trip_ms.")
        if milliseconds:
            value = _milliseconds(path, number, milliseconds)
            if value is None:
                raise _not_a_time(path, number, milliseconds)
            values.append(value)
        count[outcome] += 1
    return Record(path.stem, np.array(values, dtype=np.float64), lost=count["lost"], wrong=count["wrong"])


def _read_values(path: Path, lines: list[str]) -> Record:
    values: list[float] = []
    lost = 0
    header = False
    separators: set[str] = set()
    for number, line in enumerate(lines, start=1):
        separators |= {";", ","} & set(line)
        if len(separators) > 1:
            # "692,845;" could be two times or one with a decimal comma.
            raise FileError(
                path,
                number,
                "uses both ; and , in one file.",
                "Separate with one of them and write decimals with a point.",
            )
        *inner, last = (token.strip() for token in line.replace(",", ";").split(";"))
        for token in [*inner, last] if last else inner:
            if not token:
                raise FileError(
                    path, number, "a value is missing between two separators.", "Remove the empty field."
                )
            if token.lower() == "nan":
                lost += 1
                continue
            value = _milliseconds(path, number, token)
            if value is not None:
                values.append(value)
            elif values or lost or header or token[0].isdigit():
                raise _not_a_time(path, number, token)
            else:
                header = True
    if not values and not lost:
        raise FileError(path, None, "holds no times.", "Give a file of round-trip times in ms.")
    return Record(path.stem, np.array(values, dtype=np.float64), lost=lost)


def _milliseconds(path: Path, number: int, token: str) -> float | None:
    """Return the time a token stands for, None if it is a word."""
    try:
        value = float(token)
    except ValueError:
        return None
    if not math.isfinite(value) or value < 0:
        raise _not_a_time(path, number, token)
    return value


def _not_a_time(path: Path, number: int, token: str) -> FileError:
    return FileError(
        path,
        number,
        f"{token!r} is not a time in ms.",
        "Times are numbers from 0 on without a unit, as in 12.5.",
    )
