"""Options that several verbs share."""

from __future__ import annotations

import sys
from contextlib import contextmanager, redirect_stdout
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reconros_zenoh.transport.base import is_name

if TYPE_CHECKING:
    from collections.abc import Iterator


ENDPOINT = "tcp/127.0.0.1:7447"
"""Where rmw_zenoh's router listens, and ours."""


def _checked_group(name: str | None) -> str | None:
    if name is not None and not is_name(name):
        raise typer.BadParameter(f"{name!r} cannot name a group. Use letters, digits, `-`, `_` and `.`.")
    return name


class ClockName(StrEnum):
    """The two clocks."""

    WALL = "wall"
    VIRTUAL = "virtual"


Profile = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="The kind of board; native models nothing (wall time only).")
]
ProjectProfile = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="The kind of board; native models nothing.",
        show_default="that of TargetBoard, or native",
    ),
]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Folder for the records.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of requests and model.")]
Router = Annotated[
    str, typer.Option(metavar="ENDPOINT", envvar="RECONROS_ROUTER", help="The Zenoh router to connect to.")
]
Domain = Annotated[int, typer.Option(min=0, max=232, envvar="ROS_DOMAIN_ID", help="The ROS domain.")]
MappingName = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="Which callback runs where.",
        show_default="the first in PROJECT/mappings; without any, in hardware what can be",
    ),
]
BoardName = Annotated[str, typer.Option(help="The board's name in the network.")]
ModelSeed = Annotated[int, typer.Option(min=0, help="Seed of what is random in the model.")]
Group = Annotated[
    str | None,
    typer.Option(
        help="Begin together with the others of this group.", show_default=False, callback=_checked_group
    ),
]
Members = Annotated[int, typer.Option(min=1, help="How many members the group has.")]
Bitstreams = Annotated[
    Path | None,
    typer.Option(help="Folder of `reconros build`.", show_default="bitstreams held in memory"),
]
TraceFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        envvar="RECONROS_TRACE",
        help="Write what ran where and when: .json for Perfetto, or drawn, .png or .svg.",
        show_default=False,
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


@contextmanager
def project_prints(*, as_json: bool) -> Iterator[None]:
    """Let what a project prints while the block runs go to stderr, where stdout is for one JSON object."""
    with redirect_stdout(sys.stderr if as_json else sys.stdout):
        yield
