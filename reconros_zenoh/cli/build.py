"""`reconros build`: the bitstream files of a project."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from reconros_zenoh.cli.options import AsJson, ProjectProfile, project_prints
from reconros_zenoh.project.loader import load_project


def build(
    project: Annotated[Path, typer.Argument(help="Folder of a ReconROS project.")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where to write.", show_default="PROJECT/bitstreams")
    ] = None,
    profile: ProjectProfile = None,
    as_json: AsJson = False,
) -> None:
    """Write a project's partial bitstreams.

    One for each callback and each reconfigurable slot it can be built for. The profile decides their sizes.
    """
    folder = out or project / "bitstreams"
    with project_prints(as_json=as_json):
        loaded = load_project(project)
    bitstreams = loaded.bitstreams(loaded.profile(profile))
    written = [bitstream.write(folder) for bitstream in bitstreams]
    if as_json:
        print(
            json.dumps(
                {
                    "bitstreams": [
                        {"file": str(path), "slot": b.slot, "callback": b.callback, "bytes": b.size}
                        for path, b in zip(written, bitstreams, strict=True)
                    ]
                }
            )
        )
        return
    for path, bitstream in zip(written, bitstreams, strict=True):
        print(f"{path}  {bitstream.size} bytes")
    if not bitstreams:
        print(f"{project} has no callback that is built for a reconfigurable slot: there is nothing to write")
