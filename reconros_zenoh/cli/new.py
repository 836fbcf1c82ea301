"""`reconros new`: a project to begin with."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from reconros_zenoh.project.template import new_project


def new(name: Annotated[Path, typer.Argument(metavar="NAME", help="The project, and its folder.")]) -> None:
    """Make a project that runs.

    It has one callback, in software and in hardware.
    """
    for path in new_project(name):
        print(path)
    print(f"Try it: reconros run {quote(str(name))} --clock virtual")
