"""`reconros router`, `board`, `client` and `status`: the processes of a deployment."""

from __future__ import annotations

import json
import signal
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from reconros_zenoh.board.control import ask_status
from reconros_zenoh.cli.console import wide_console
from reconros_zenoh.cli.options import (
    ENDPOINT,
    AsJson,
    Bitstreams,
    BoardName,
    Domain,
    Group,
    MappingName,
    Members,
    ModelSeed,
    ProjectProfile,
    Router,
    TraceFile,
)
from reconros_zenoh.cli.status_screen import print_status
from reconros_zenoh.clock.signals import ending_signals
from reconros_zenoh.experiments.roundtrip import Client, application_folder
from reconros_zenoh.transport.zenoh import ZenohRouter, ZenohTransport
from reconros_zenoh.transport.zenoh_session import use_threads_of_a_router


def router(
    listen: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT", help="Where to listen; tcp/[::]:7447 takes sessions of other hosts too."
        ),
    ] = ENDPOINT,
) -> None:
    """Run a Zenoh router until Ctrl-C.

    Any rmw_zenoh router serves as well.
    """
    use_threads_of_a_router()
    endings = ending_signals()
    # `sigwait` only takes signals that are blocked, in Zenoh's threads too.
    signal.pthread_sigmask(signal.SIG_BLOCK, endings)
    # A thread that was there before the mask may take a signal that comes just before or after the wait.
    with ZenohRouter.open(listen), suppress(KeyboardInterrupt):
        print(f"router listens on {listen}", flush=True)
        number = signal.sigwait(endings)
        # Handled as everywhere, so that a second one, as `timeout` sends, is ignored while the router ends.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, endings)
        signal.raise_signal(number)


def board(
    project: Annotated[
        Path | None,
        typer.Argument(help="Folder of a ReconROS project.", show_default="the round-trip application"),
    ] = None,
    mapping: MappingName = None,
    profile: ProjectProfile = None,
    name: BoardName = "board0",
    router: Router = ENDPOINT,
    domain: Domain = 0,
    seed: ModelSeed = 0,
    bitstreams: Bitstreams = None,
    tap: Annotated[
        bool, typer.Option("--tap", help="Let hardware-mapped topics out, as hmt/<board>/<topic>.")
    ] = False,
    trace: TraceFile = None,
) -> None:
    """Run an emulated board that hosts a project, until Ctrl-C."""
    from board_daemon.daemon import run_board
    from reconros_zenoh.project.hosting import BoardOptions
    from reconros_zenoh.project.loader import load_project

    loaded = load_project(project or application_folder())
    model, mapped = loaded.profile(profile), loaded.mapping(mapping)
    run_board(
        router,
        model,
        loaded,
        mapped,
        BoardOptions(name, domain, seed, bitstreams, tap, trace),
        lambda: print(
            f"board {name} serves {loaded.configuration.name} under {mapped.name} on {model.name}", flush=True
        ),
    )


def client(
    name: Annotated[Client, typer.Argument(help="Which client.")],
    requests: Annotated[int, typer.Option(min=1, help="How many round trips to make.")] = 100,
    router: Router = ENDPOINT,
    domain: Domain = 0,
    limit: Annotated[
        float,
        typer.Option(
            min=0.001,
            max=86400,
            metavar="SECONDS",
            help="After this time an answer is lost. A modelled board may need 3 s for a large message.",
        ),
    ] = 2.0,
    wait: Annotated[
        float, typer.Option(min=0.1, max=86400, metavar="SECONDS", help="How long to wait for a board.")
    ] = 30.0,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record each round trip there.", show_default=False)
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the requests.")] = 0,
    group: Group = None,
    members: Members = 1,
    as_json: AsJson = False,
) -> None:
    """Make round trips to a board and check every answer.

    The next request leaves when the answer to the last one is in.
    """
    from host_clients.command import make_round_trips
    from host_clients.daemon import ClientOptions

    options = ClientOptions(name, requests, limit, wait, domain, seed, group, members)
    raise typer.Exit(make_round_trips(router, options, out, as_json=as_json))


def status(
    name: Annotated[str, typer.Argument(help="The board, or `router`.")] = "board0",
    router: Router = ENDPOINT,
    as_json: AsJson = False,
) -> None:
    """Show what a board is doing.

    Exit status 2 when it does not answer.
    """
    with ZenohTransport.open(router, as_client=True) as transport:
        answer = {"router": router} if name == "router" else ask_status(transport, name)
    if as_json:
        print(json.dumps(answer))
    elif name == "router":
        print(f"a router listens on {router}")
    else:
        print_status(wide_console(), answer)
