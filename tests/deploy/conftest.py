"""Small services for the runner: programs that block until they are told to end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import psutil
import pytest
from ruamel.yaml import YAML

from deploy.compose import ComposeService, Deployment, Healthcheck, StartCondition

if TYPE_CHECKING:
    from pathlib import Path

OFTEN_NS = 10**7
PATIENT = 10**6

PRELUDE = """\
import os, pathlib, signal, subprocess, sys
folder = pathlib.Path({folder!r})
def write(name, text=""):
    (folder / (name + ".new")).write_text(text)
    (folder / (name + ".new")).rename(folder / name)
def block():
    while True: signal.pause()
write({name!r} + ".pid", str(os.getpid()))
"""


class Services:
    """Makes deployments whose programs leave their process numbers, so that survivors can be found."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._others = set(psutil.Process().children(recursive=True))

    def service(
        self, name: str, code: str, healthcheck: Healthcheck | None = None, **depends_on: str
    ) -> ComposeService:
        """Return a service that runs the code, in which `write(name, text)` and `block()` are known."""
        program = PRELUDE.format(folder=str(self.folder), name=name) + code
        conditions = {other: StartCondition(f"service_{word}") for other, word in depends_on.items()}
        return ComposeService(name, ("python", "-c", program), {}, conditions, healthcheck)

    def when_written(self, name: str) -> Healthcheck:
        """Return the healthcheck of a service that is healthy as soon as it has written the file."""
        return Healthcheck(("test", "-e", str(self.folder / name)), OFTEN_NS, retries=PATIENT)

    def deployment(self, *services: ComposeService) -> Deployment:
        return Deployment(self.folder / "compose.yaml", {service.name: service for service in services})

    def compose_file(self, *services: ComposeService) -> Path:
        """Write the services as a Compose file."""
        content: dict[str, dict[str, object]] = {}
        for service in services:
            entry = content[service.name] = {
                "command": list(service.command),
                "depends_on": {name: {"condition": str(c)} for name, c in service.depends_on.items()},
            }
            if service.healthcheck is not None:
                entry["healthcheck"] = {
                    "test": ["CMD", *service.healthcheck.command],
                    "interval": f"{service.healthcheck.interval_ns // 1000}us",
                    "retries": service.healthcheck.retries,
                }
        path = self.folder / "compose.yaml"
        with path.open("w") as file:
            YAML(typ="safe").dump({"services": content}, file)
        return path

    def assert_gone(self) -> None:
        """Fail when this process has a child that it had not before, or a process that left its number lives.

        The latter may be orphans, whose end takes a moment to be noticed: they get 30 s.
        """
        assert set(psutil.Process().children(recursive=True)) <= self._others
        numbers = [int(file.read_text()) for file in self.folder.glob("*.pid")]
        orphans = [psutil.Process(number) for number in numbers if psutil.pid_exists(number)]
        assert not psutil.wait_procs(orphans, timeout=30)[1]


@pytest.fixture
def services(tmp_path: Path) -> Services:
    return Services(tmp_path)
