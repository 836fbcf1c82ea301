"""What is kept of a deployment between `up` and `down`: who runs it, how it stands, and its logs."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import signal
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


@dataclass(frozen=True, slots=True)
class Record:
    """What runs, the process that runs it, the states in which it left the services, and what went wrong."""

    file: str
    pid: int
    states: Mapping[str, str]
    error: str


class StateFolder:
    """The folder of one Compose file below `$XDG_STATE_HOME/reconros` (default `~/.local/state/reconros`).

    `lock` is locked for as long as the deployment runs: the kernel gives it free however its owner ends, so a
    stale folder cannot be taken for a running deployment, nor a reused process number for its owner. `record`
    says whom to ask to stop. `logs` has the logs of the last run.
    """

    def __init__(self, compose_file: Path, environment: Mapping[str, str]) -> None:
        self._compose_file = compose_file
        file = compose_file.resolve()
        key = hashlib.sha256(os.fsencode(file)).hexdigest()[:12]
        self.path = _home(environment) / f"{file.stem}-{key}"
        self.logs = self.path / "logs"
        self._lock = self.path / "lock"
        self._record = self.path / "record.json"

    def make(self) -> None:
        """Make the folder if it is not there yet."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(
                self.path, None, f"cannot be made ({error}).", "Set XDG_STATE_HOME to a folder of yours."
            ) from None

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Make this process the owner; raise UsageError when the deployment is running."""
        self.make()
        with self._lock.open("ab") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise UsageError(
                    f"{self._compose_file} is up already; its logs are in {self.logs}. "
                    f"Stop it first: reconros down -f {self._compose_file}"
                ) from None
            # Stands until `leave` replaces it, so it tells what is true if that never happens.
            self.leave({}, "The process that ran it was killed.")
            yield

    def leave(self, states: Mapping[str, str], error: str) -> None:
        """Record how the owner, this process, leaves the deployment."""
        record = Record(str(self._compose_file.resolve()), os.getpid(), states, error)
        new = self._record.with_suffix(".new")
        new.write_text(json.dumps(asdict(record)), encoding="utf-8")
        new.replace(self._record)  # at once, so that nobody reads half a record

    def end_owner(self) -> Record | None:
        """Stop the deployment if it is running; return its last record and forget it.

        None means that there is nothing to stop and nothing to tell.
        """
        if not self._record.exists():
            return None
        with self._lock.open("ab") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                with suppress(ProcessLookupError):  # it has just ended by itself
                    os.kill(_read(self._record).pid, signal.SIGTERM)
                fcntl.flock(lock, fcntl.LOCK_EX)  # the owner lets go when everything has stopped
            record = _read(self._record)
            self._record.unlink()
            return record


def running(environment: Mapping[str, str]) -> list[Path]:
    """Return the Compose files whose deployments this user has running."""
    files = []
    for record in _home(environment).glob("*/record.json"):
        if _is_locked(record.with_name("lock")):
            with suppress(FileNotFoundError):  # it has just ended, and another `down` has told of it
                files.append(Path(_read(record).file))
    return sorted(files)


def _home(environment: Mapping[str, str]) -> Path:
    home = environment.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(home) / "reconros"


def _is_locked(path: Path) -> bool:
    with path.open("ab") as lock:
        try:
            # Shared: two that look at the same time must not take each other for an owner.
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def _read(record: Path) -> Record:
    try:
        return Record(**json.loads(record.read_text(encoding="utf-8")))
    except TypeError:
        raise FileError(
            record, None, "was written by another version of reconros.", "Use that one, or remove the file."
        ) from None
