"""What is kept of a deployment between `up` and `down`: who runs it, how it stands, and its logs."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import signal
import struct
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.text_file import replacing

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from typing import BinaryIO

# <fcntl.h> of Linux: l_type, l_whence, l_start, l_len, l_pid of a struct flock
_FLOCK = "hhqqi0q"
# The bytes of `lock` that are locked by who runs the deployment and by who stops it
_RUNS, _STOPS = 0, 1


@dataclass(frozen=True, slots=True)
class DeploymentRecord:
    """What runs, the states in which its services were left, and what went wrong."""

    file: str
    states: Mapping[str, str]
    error: str


class StateFolder:
    """The folder of one Compose file below `$XDG_STATE_HOME/reconros` (default `~/.local/state/reconros`).

    `lock` is locked for as long as the deployment runs: the kernel gives it free however its owner ends, so a
    stale folder cannot be taken for a running deployment, and says who the owner is, so that nobody else is
    asked to stop. (A POSIX lock: an owner that opens and closes the file once more loses it.) `record` says
    how the deployment was left. `logs` has the logs of the last run.
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
                fcntl.lockf(lock, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _RUNS)
            except BlockingIOError:
                raise UsageError(
                    f"{self._compose_file} is up already; its logs are in {self.logs}. "
                    f"Stop it first: reconros down -f {quote(str(self._compose_file))}"
                ) from None
            # Stands until `leave` replaces it, so it tells what is true if that never happens.
            self.leave({}, "The process that ran it was killed, or found no room to write how it ended.")
            yield

    def leave(self, states: Mapping[str, str], error: str) -> None:
        """Record how the owner, this process, leaves the deployment; raise FileError if it cannot."""
        record = DeploymentRecord(str(self._compose_file.resolve()), states, error)
        try:
            with replacing(self._record) as new:
                new.write_text(json.dumps(asdict(record)), encoding="utf-8")
        except OSError as failure:
            raise FileError(
                self._record,
                None,
                f"cannot be written ({failure.strerror}).",
                "Make room, or set XDG_STATE_HOME to another folder.",
            ) from None

    def end_owner(self) -> DeploymentRecord | None:
        """Stop the deployment if it is running; return its last record and forget it.

        None means that there is nothing to stop and nothing to tell. Raise UsageError when it runs elsewhere.
        """
        try:
            with self._lock.open("r+b") as lock:
                # One after another: the owner takes a second signal for one of a user in a hurry.
                fcntl.lockf(lock, fcntl.LOCK_EX, 1, _STOPS)
                owner = _owner(lock)
                if owner is not None:
                    if owner <= 0:
                        raise UsageError(
                            f"{self._compose_file} is up on another host or in a container. Stop it there."
                        )
                    with suppress(ProcessLookupError):  # it has just ended by itself
                        os.kill(owner, signal.SIGTERM)
                # The owner lets go when everything has stopped. Shared: this process owns nothing.
                fcntl.lockf(lock, fcntl.LOCK_SH, 1, _RUNS)
                record = _read(self._record)
                self._record.unlink()
                return record
        except FileNotFoundError:  # it was never up, or another `down` has told of it
            return None


def running(environment: Mapping[str, str]) -> list[Path]:
    """Return the Compose files whose deployments this user has running."""
    files = []
    for record in _home(environment).glob("*/record.json"):
        with suppress(FileNotFoundError), record.with_name("lock").open("rb") as lock:
            if _owner(lock) is not None:
                files.append(Path(_read(record).file))
    return sorted(files)


def _home(environment: Mapping[str, str]) -> Path:
    home = environment.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(home) / "reconros"


def _owner(lock: BinaryIO) -> int | None:
    """Return the process that runs the deployment, 0 or less for one elsewhere, or None.

    What waits for its end is not taken for it: that has a shared lock.
    """
    asked = struct.pack(_FLOCK, fcntl.F_RDLCK, os.SEEK_SET, _RUNS, 1, 0)
    kind, *_, process = struct.unpack(_FLOCK, fcntl.fcntl(lock, fcntl.F_GETLK, asked))
    return None if kind == fcntl.F_UNLCK else process


def _read(record: Path) -> DeploymentRecord:
    try:
        return DeploymentRecord(**json.loads(record.read_text(encoding="utf-8")))
    except (TypeError, ValueError):  # a host that lost power may leave it empty
        raise FileError(
            record, None, "is not what this version of reconros writes.", "Use the other, or remove the file."
        ) from None
