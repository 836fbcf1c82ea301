"""Options that several verbs share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class ClockName(StrEnum):
    """The two clocks."""

    WALL = "wall"
    VIRTUAL = "virtual"


Profile = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="The kind of board; native models nothing (wall time only).")
]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Folder for the records.")]
Seed = Annotated[int, typer.Option(help="Seed of requests and model.")]
