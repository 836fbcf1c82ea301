"""Keeps a deployment running until all of its services have ended: in this process or in one of its own.

As a program, `python -P -m deploy.supervisor FILE`, it tells its parent in lines of JSON on standard output
each change of a service's state, and then that all are ready or what went wrong; after that it is alone.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deploy.compose import read_compose
from deploy.runner import LocalRunner
from deploy.service_run import ServiceState
from deploy.state import StateFolder
from reconros_zenoh.errors import ExperimentError, FileError, ReconrosError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from deploy.compose import Deployment

_USAGE_STATUS = 2
_STOPPED_STATUS = 128 + signal.SIGTERM


def supervise(
    deployment: Deployment,
    folder: StateFolder,
    environment: Mapping[str, str],
    on_event: Callable[[str, ServiceState], None],
    on_ready: Callable[[], None] = lambda: None,
) -> None:
    """Run the deployment until all services have ended with status 0.

    Raise ExperimentError when one fails and UsageError when the deployment is already running. The folder
    keeps how it ended.
    """
    with folder.claimed():
        runner = LocalRunner(deployment, folder.logs, environment, on_event=on_event)
        error = ""
        try:
            with runner:
                runner.wait_until_ready()
                on_ready()
                runner.run_until(deployment.services.keys())
        except ReconrosError as failure:
            error = str(failure)
            raise
        finally:
            with suppress(FileError):  # then what it says since the start stands
                folder.leave(runner.states, error)


def start_supervisor(
    file: Path,
    folder: StateFolder,
    environment: Mapping[str, str],
    on_event: Callable[[str, ServiceState], None],
) -> None:
    """Run the deployment in a process of its own; return when all services are ready.

    Raise what `supervise` raises, KeyboardInterrupt when it is stopped before. When this process is
    interrupted or dies before, everything is stopped.
    """
    folder.make()
    log = folder.path / "supervisor.log"
    with log.open("ab") as errors:
        process = subprocess.Popen(
            # -P: a folder `deploy` in which the user happens to stand must not be taken for this package.
            [sys.executable, "-P", "-m", "deploy.supervisor", file],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=errors,
            start_new_session=True,
        )
    assert process.stdout is not None
    with process.stdout as stream:
        try:
            message = _pass_on(stream, on_event)
        except KeyboardInterrupt:
            process.terminate()
            _pass_on(stream, on_event)
            process.wait()
            raise
    if "ready" in message:
        return
    status = process.wait()
    if status == _STOPPED_STATUS:  # by `down`, as one in the foreground
        raise KeyboardInterrupt
    if "error" not in message:
        raise ExperimentError(f"The supervisor of {file} ended with status {status}. Its log is {log}.")
    raise (UsageError if status == _USAGE_STATUS else ExperimentError)(message["error"])


def _pass_on(stream: Iterable[bytes], on_event: Callable[[str, ServiceState], None]) -> dict[str, Any]:
    """Return the message after the events, nothing when there is none."""
    for line in stream:
        message: dict[str, Any] = json.loads(line)
        if "service" not in message:
            return message
        on_event(message["service"], ServiceState(message["state"]))
    return {}


def _main(file: Path) -> int:
    environment = dict(os.environ)
    parent = _Parent()
    try:
        supervise(
            read_compose(file, environment),
            StateFolder(file, environment),
            environment,
            on_event=lambda service, state: parent.tell(service=service, state=state),
            on_ready=parent.tell_ready,
        )
    except ReconrosError as error:
        parent.tell(error=str(error))
        with suppress(OSError):  # of a full disk
            print(error, file=sys.stderr)  # for its log: the parent may have gone
        return _USAGE_STATUS if isinstance(error, UsageError) else 1
    return 0


class _Parent:
    """The process that waits for the deployment to get ready."""

    def __init__(self) -> None:
        self._listens = True

    def tell(self, **message: object) -> None:
        if not self._listens:
            return
        try:
            os.write(1, json.dumps(message).encode() + b"\n")
        except BrokenPipeError:  # it died: nobody wants the deployment any more
            self._listens = False
            os.kill(os.getpid(), signal.SIGTERM)

    def tell_ready(self) -> None:
        self.tell(ready=True)
        self._listens = False


if __name__ == "__main__":
    sys.exit(_main(Path(sys.argv[1])))
