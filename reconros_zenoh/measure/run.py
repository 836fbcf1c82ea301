"""A run on disk: the folder `<out>/<clock>/` of one experiment."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, ValidationError

from reconros_zenoh.errors import FileError
from reconros_zenoh.measure.record import Record, read_record
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from pathlib import Path

_LIMIT_BYTES = 10_000_000
_REMEDY = "Give the folder <out>/<clock> that an experiment wrote."


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)


class _Cell(_Part):
    n: int
    lost: int
    wrong: int
    mean_ms: float | None
    p5_ms: float | None
    p25_ms: float | None
    median_ms: float | None
    p75_ms: float | None
    p95_ms: float | None
    p99_ms: float | None
    max_ms: float | None
    reference_median_ms: float | None
    median_error: float | None


class _Host(_Part):
    overruns: int | None
    lag_p50_us: float | None
    lag_p99_us: float | None


class _Experiment(_Part):
    experiment: str
    clock: str
    requests: int
    seed: int | None
    mappings: dict[str, dict[str, _Cell]]
    speedup_of_means: dict[str, dict[str, float | None]]
    speedup_of_medians: dict[str, dict[str, float | None]]
    host: _Host
    spans: dict[str, dict[str, dict[str, float]]] | None = None
    versions: dict[str, str] | None = None


def load_run(folder: Path) -> tuple[dict[str, Any], dict[str, dict[str, Record]]]:
    """Return the object in `experiment.json` and its records as `records[mapping][client]`.

    The records of all mappings and clients that the object names are read. Raises FileError if a file is
    missing or does not hold what an experiment writes.
    """
    path = folder / "experiment.json"
    try:
        experiment = json.loads(read_text_file(path, _REMEDY, _LIMIT_BYTES))
        _Experiment.model_validate(experiment)
    except json.JSONDecodeError as error:
        raise FileError(path, error.lineno, f"is not JSON: {error.msg}.", _REMEDY) from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the file"
        raise FileError(path, None, f"is not an experiment: {place}: {first['msg']}.", _REMEDY) from error
    except (RecursionError, ValueError) as error:  # nested by the thousand, a number of thousands of digits
        raise FileError(path, None, f"is not an experiment: {error}.", _REMEDY) from error
    records = {
        mapping: {client: read_record(folder / mapping / f"{client}.csv") for client in clients}
        for mapping, clients in experiment["mappings"].items()
    }
    return experiment, records
