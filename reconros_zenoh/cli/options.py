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
ENDPOINT = "tcp/127.0.0.1:7447"
Router = Annotated[
    str, typer.Option(metavar="ENDPOINT", envvar="RECONROS_ROUTER", help="The Zenoh router to connect to.")
]
Domain = Annotated[int, typer.Option(min=0, max=232, envvar="ROS_DOMAIN_ID", help="The ROS domain.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
