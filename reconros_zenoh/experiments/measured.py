"""Round trips that somebody measured on a board, by mapping and client."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.experiments.roundtrip import CLIENTS
from reconros_zenoh.measure.compare import LOGGED_MODULO_MS
from reconros_zenoh.measure.record import read_record

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import numpy.typing as npt

    from reconros_zenoh.project.loader import Project

QUARTILES = (25.0, 50.0, 75.0)

_FEWEST = 20


@dataclass(frozen=True, eq=False)
class MeasuredMapping:
    """What was measured under one mapping: the folder's name, the mapping file, and the quartiles per client.

    `quartiles_ms[client]` is float64 of shape `(3,)`: the 25th, 50th and 75th percentile modulo 1 s, as the
    clients of the paper logged their times.
    """

    name: str
    mapping: Path
    quartiles_ms: Mapping[str, npt.NDArray[np.float64]]


def quartiles_ms(values_ms: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the three quartiles [ms] of at least one time, modulo 1 s."""
    return np.percentile(values_ms % LOGGED_MODULO_MS, QUARTILES)


def read_measurements(
    folders: Sequence[Path], project: Project, given: Mapping[str, str], *, trim: bool
) -> list[MeasuredMapping]:
    """Return the measured mappings below the folders: one folder per mapping, one file per client in it.

    A folder NAME belongs to the mapping `given[NAME]` (name or file), to the file NAME.toml in it or beside
    it, or to the project's mapping of that name. With `trim` the first and the last value of each file are
    left out. Raise FileError with the line for what is no time, for a client nobody knows, for too few values
    and for a folder whose mapping is not known; UsageError for a name in `given` that was not measured.
    """
    measured: dict[str, MeasuredMapping] = {}
    for folder in folders:
        if not folder.is_dir():
            raise FileError(folder, None, "is no folder.", "Give a folder with one folder per mapping.")
        records = sorted(folder.glob("*/*.csv"))
        if not records:
            raise FileError(
                folder, None, "holds no measurements.", "Lay them down as <folder>/<mapping>/<client>.csv."
            )
        for path in dict.fromkeys(record.parent for record in records):
            if path.name in measured:
                raise FileError(path, None, "is a second folder for this mapping.", "Give each mapping once.")
            measured[path.name] = MeasuredMapping(
                path.name,
                _mapping_file(path, project, given),
                {record.stem: _read_cell(record, trim=trim) for record in records if record.parent == path},
            )
    if unused := given.keys() - measured:
        name = min(unused)
        raise UsageError(f"--mapping {name}=...: no folder {name} was measured. Correct the name.")
    return list(measured.values())


def _mapping_file(folder: Path, project: Project, given: Mapping[str, str]) -> Path:
    """Return the file of the folder's mapping once it has been read without a mistake."""
    name = folder.name
    beside = (folder / f"{name}.toml", folder.parent / f"{name}.toml")
    found = given.get(name) or next((str(file) for file in beside if file.is_file()), name)
    try:
        path = project.mapping_path(found)
    except UsageError as error:
        raise FileError(
            folder, None, f"{error}", f"Or write {name}.toml beside the folder, or say --mapping {name}=FILE."
        ) from None
    project.mapping(str(path))
    return path.resolve()


def _read_cell(path: Path, *, trim: bool) -> npt.NDArray[np.float64]:
    if path.stem not in CLIENTS:
        raise FileError(
            path,
            None,
            f"no client is named {path.stem!r}.",
            f"Clients of this application: {', '.join(CLIENTS)}.",
        )
    values_ms = read_record(path).values_ms
    if trim:
        values_ms = values_ms[1:-1]
    if values_ms.size < _FEWEST:
        raise FileError(
            path,
            None,
            f"holds {values_ms.size} times, too few for quartiles.",
            f"Measure {_FEWEST} or more.",
        )
    quartiles = quartiles_ms(values_ms)
    if not quartiles[0] > 0:
        raise FileError(
            path, None, "a quarter of its times are 0 ms.", "Measure with a clock that is fine enough."
        )
    return quartiles
