"""`reconros camera`, `viewer` and `robot`: the desktops of the examples."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from reconros_zenoh.cli.options import ENDPOINT, Domain, Group, Members, Router

Rate = Annotated[
    float,
    typer.Option(min=0.1, max=1000, metavar="HZ", help="How many pictures per second the camera takes."),
]

Pictures = Annotated[int, typer.Option(min=1, help="How many pictures to publish.")]
Wait = Annotated[
    float, typer.Option(min=0.1, max=86400, metavar="SECONDS", help="How long to wait for a subscriber.")
]
View = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=65535,
        metavar="PORT",
        envvar="RECONROS_VIEW",
        help="Show the pictures in the browser, at this port of 127.0.0.1; 0 takes a free one.",
        show_default=False,
    ),
]


def camera(
    pictures: Pictures = 100,
    rate: Rate = 5.0,
    router: Router = ENDPOINT,
    domain: Domain = 0,
    wait: Wait = 30.0,
    group: Group = None,
    members: Members = 1,
) -> None:
    """Publish a moving test picture on /image_raw.

    It ends 2 s after the last picture.
    """
    from host_clients.camera import CameraOptions
    from host_clients.desktop import run_camera

    options = CameraOptions(pictures, rate, wait, domain, group, members)
    sent = run_camera(router, options, lambda: print("camera: ready", flush=True))
    print(f"camera: {sent} pictures published", flush=True)
    raise typer.Exit(0 if sent == pictures else 130)


def viewer(
    rate: Rate = 5.0,
    router: Router = ENDPOINT,
    domain: Domain = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where last.png, filtered.gif, filter.csv and control.csv go.",
            show_default=False,
        ),
    ] = None,
    view: View = None,
    group: Group = None,
    members: Members = 1,
) -> None:
    """Check the pictures of /image_filtered until Ctrl-C.

    It measures the control loop as well.
    """
    from host_clients.desktop import ViewerOptions, run_viewer

    options = ViewerOptions(out, view, rate, domain, group, members)
    counts = run_viewer(router, options, partial(_tell, "viewer"))
    print(
        f"viewer: {counts['pictures']} filtered pictures and {counts['indices']} servo indices came",
        flush=True,
    )


def robot(
    pictures: Pictures = 300,
    router: Router = ENDPOINT,
    domain: Domain = 0,
    wait: Wait = 30.0,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where robot.csv goes.", show_default=False)
    ] = None,
    view: View = None,
) -> None:
    """Be the robot of the driving example.

    It publishes ten pictures a second on /image_raw and does what comes on /drive, and ends 2 s after the
    last picture. robot.csv has the times from picture to command.
    """
    from host_clients.desktop import run_robot
    from host_clients.robot import RobotOptions, most_off_lane_mm, stood_s

    driven = run_robot(router, RobotOptions(pictures, out, view, wait, domain), partial(_tell, "robot"))
    pictures = len(driven.steps)
    print(f"robot: {pictures} pictures published, {pictures - driven.unanswered} answered", flush=True)
    if driven.unexpected:
        print(f"robot: {driven.unexpected} other commands came, for no picture of this robot", flush=True)
    if driven.steps:
        beside_mm, at_red_s, else_s = (
            most_off_lane_mm(driven.steps),
            *(stood_s(driven.steps, red=red) for red in (True, False)),
        )
        print(
            f"robot: at most {beside_mm:.0f} mm beside the middle of the lane; stood for {at_red_s:.1f} s at "
            f"the red light, {else_s:.1f} s else",
            flush=True,
        )
    raise typer.Exit(0 if driven.done.triggered else 130)


def _tell(name: str, url: str | None) -> None:
    print(f"{name}: ready" + (f", the pictures are at {url}" if url else ""), flush=True)
