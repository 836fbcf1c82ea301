"""Small services for the runner: programs that block until they are told to go on."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import psutil
import pytest

from deploy.compose import Condition, Deployment, Healthcheck, Service

if TYPE_CHECKING:
    from pathlib import Path

READY = "import os, pathlib, signal, sys\nname = os.environ['NAME']\n"
"""What each program begins with."""


class Services:
    """Makes deployments whose services write their process numbers, so that a test can look for survivors."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def service(
        self,
        name: str,
        code: str,
        *,
        healthy_when_written: bool = False,
        healthcheck: Healthcheck | None = None,
        **depends_on: Condition,
    ) -> Service:
        """Return a service that runs the code in the folder, after writing its process number to `<name>.pid`.

        `write(file)` in the code makes a file and `pause()` blocks for ever. With `healthy_when_written` the
        service is healthy as soon as the file `<name>.ready` is there.
        """
        prelude = (
            "import os, pathlib, signal, subprocess, sys\n"
            f"folder = pathlib.Path({str(self.folder)!r})\n"
            "def write(name, text=''):\n"
            "    (folder / (name + '.new')).write_text(text)\n"
            "    (folder / (name + '.new')).rename(folder / name)\n"
            "def pause():\n"
            "    while True: signal.pause()\n"
            f"write({name + '.pid'!r}, str(os.getpid()))\n"
        )
        if healthy_when_written:
            healthcheck = Healthcheck(
                ("test", "-e", str(self.folder / f"{name}.ready")), 10**7, retries=10**6
            )
        return Service(name, ("python", "-c", prelude + code), {}, depends_on, healthcheck)

    def deployment(self, *services: Service) -> Deployment:
        return Deployment(self.folder / "compose.yaml", {service.name: service for service in services}, {})

    def compose_file(self, *services: Service) -> Path:
        """Write the services as a Compose file."""
        from ruamel.yaml import YAML  # noqa: PLC0415

        content: dict[str, dict[str, object]] = {}
        for service in services:
            content[service.name] = {
                "command": [word.replace("$", "$$") for word in service.command],
                "depends_on": {name: {"condition": str(c)} for name, c in service.depends_on.items()},
            }
            if service.healthcheck is not None:
                content[service.name]["healthcheck"] = {
                    "test": ["CMD", *service.healthcheck.command],
                    "interval": f"{service.healthcheck.interval_ns // 1000}us",
                    "retries": service.healthcheck.retries,
                }
        path = self.folder / "compose.yaml"
        with path.open("w") as file:
            YAML(typ="safe").dump({"services": content}, file)
        return path

    def pid(self, name: str) -> int:
        return int((self.folder / f"{name}.pid").read_text())

    def assert_gone(self) -> None:
        """Fail when a process of a service is there, or stays for more than 10 s."""
        numbers = [int(file.read_text()) for file in self.folder.glob("*.pid")]
        assert numbers
        processes = [psutil.Process(number) for number in numbers if psutil.pid_exists(number)]
        _, alive = psutil.wait_procs(processes, timeout=10)
        assert not alive
