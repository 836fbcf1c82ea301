"""What an experiment's object says besides its figures: when, where, with what; and where it is written."""

from __future__ import annotations

import json
import os
import platform
import shlex
import sys
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib.metadata import version
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.file_lock import lock

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path


def machine() -> str:
    """Return the kind of this computer and the number of its cores."""
    return f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"


def versions() -> dict[str, str]:
    """Return the versions of this program and of what its results rest on."""
    packages = ("reconros-zenoh", "eclipse-zenoh", "simpy", "numpy")
    return {name: version(name) for name in packages} | {"Python": platform.python_version()}


def provenance() -> dict[str, Any]:
    """Return the date, the command and the versions of what took part."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["reconros", *sys.argv[1:]]),
        "versions": versions(),
    }


def host(overruns: int | None) -> dict[str, Any]:
    """Return what is known of this host, and how often it was slower than the model (None: not known)."""
    return {"machine": machine(), "overruns": overruns}


@contextmanager
def writing(place: Path) -> Iterator[None]:
    """Run the block, which writes to what --out names; raise UsageError when that fails."""
    try:
        yield
    except OSError as error:
        raise UsageError(f"{place} cannot be written ({error.strerror}). Choose another --out.") from None


@contextmanager
def own_folder(folder: Path) -> Iterator[None]:
    """Run the block with a folder that no other experiment writes to at the same time.

    Makes the folder, and removes it when nothing was written there. Raises UsageError when it cannot be made,
    when nothing can be written there, or while another experiment has it.
    """
    with writing(folder):
        made = [each for each in (folder, *folder.parents) if not each.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()  # now, rather than when the results are there
        descriptor = os.open(folder, os.O_RDONLY)
    try:
        if not lock(descriptor):
            raise UsageError(
                f"another experiment is writing to {folder}. Wait for its end, or choose another --out."
            )
        yield
    finally:
        with suppress(OSError):  # something is in it
            for each in made:
                each.rmdir()
        os.close(descriptor)


def write_experiment(folder: Path, experiment: Mapping[str, Any]) -> None:
    """Write the object as experiment.json; raise UsageError when that fails."""
    path = folder / "experiment.json"
    with writing(path):
        path.write_text(json.dumps(experiment, indent=1), encoding="utf-8")
