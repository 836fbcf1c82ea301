"""The commands of a deployment's services, read as what they would run."""

from __future__ import annotations

import functools
from collections import defaultdict
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import typer
from typer.main import get_command

from deploy.compose import StartCondition, read_compose
from host_clients.camera import CameraOptions
from host_clients.daemon import ClientOptions
from host_clients.desktop import ViewerOptions
from host_clients.robot import RobotOptions
from reconros_zenoh.cli import daemons, desktop
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.experiments.deployment import BoardPlan, DeploymentPlan
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.yaml_node import YamlNode

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from deploy.compose import ComposeService
    from reconros_zenoh.project.loader import Project

_VERBS: dict[str, Callable[..., None]] = {
    "board": daemons.board,
    "client": daemons.client,
    "camera": desktop.camera,
    "viewer": desktop.viewer,
    "robot": desktop.robot,
    "router": daemons.router,
}


def read_deployment(path: Path, environment: Mapping[str, str], *, has_end: bool = False) -> DeploymentPlan:
    """Return the boards, clients, cameras, viewers and robots of a Compose file; nothing is started.

    FileError names the service whose command cannot be simulated: another one than `reconros board`,
    `client`, `camera`, `viewer`, `robot` and `router`, options that these would refuse, a profile without
    modelled times, a client, camera or robot without a board. It says, too, when there is no board, or,
    unless it `has_end` anyway, no client, camera or robot.
    """
    services = read_compose(path, environment).services
    nodes = YamlNode.read(path, environment).mapping()["services"].mapping()
    projects = functools.cache(load_project)
    boards: dict[str, BoardPlan] = {}
    clients: dict[str, ClientOptions] = {}
    cameras: dict[str, CameraOptions] = {}
    viewers: dict[str, ViewerOptions] = {}
    robots: dict[str, RobotOptions] = {}
    for name, service in services.items():
        command = nodes[name].mapping()["command"]
        if StartCondition.COMPLETED in service.depends_on.values():
            raise nodes[name].error(
                "waits for the end of another service, which `simulate` does not know.",
                "Simulate the services that run side by side in a file of their own.",
            )
        verb, given = _parse(service, command)
        if verb == "board":
            board = _board_plan(given, command, projects)
            if board.options.name in [other.options.name for other in boards.values()]:
                raise command.error(f"names a second board {board.options.name!r}.", "Give each a --name.")
            boards[name] = board
        elif verb == "client":
            clients[name] = ClientOptions(
                given["name"],
                given["requests"],
                given["limit"],
                given["wait"],
                given["domain"],
                given["seed"],
                given["group"],
                given["members"],
            )
        elif verb == "camera":
            cameras[name] = CameraOptions(
                given["pictures"],
                given["rate"],
                given["wait"],
                given["domain"],
                given["group"],
                given["members"],
            )
        elif verb == "viewer":
            viewers[name] = ViewerOptions(domain=given["domain"], group=given["group"])
        elif verb == "robot":
            robots[name] = RobotOptions(given["pictures"], wait_s=given["wait"], domain=given["domain"])
    plan = DeploymentPlan(boards, clients, cameras, viewers, robots)
    _check_clients(plan, nodes)
    _check_end(plan, nodes, has_end=has_end)
    return plan


def _board_plan(
    given: Mapping[str, Any], command: YamlNode, projects: Callable[[Path], Project]
) -> BoardPlan:
    """Return what the options of `reconros board` ask for."""
    try:
        project = projects(given["project"] or application_folder())
        mapping, profile = project.mapping(given["mapping"]), project.profile(given["profile"])
        options = BoardOptions(
            given["name"], given["domain"], given["seed"], given["bitstreams"], trace=given["trace"]
        )
    except FileError:
        raise
    except UsageError as error:
        raise command.error(f"cannot be run: {error}", "Correct the option.") from None
    if profile.model is None:
        raise command.error(
            f"runs on {profile.name}, which models nothing: nothing would take any virtual time.",
            "Give another --profile.",
        )
    return BoardPlan(profile, project, mapping, options)


def _parse(service: ComposeService, command: YamlNode) -> tuple[str, dict[str, Any]]:
    """Return the verb of the service's command and the values of its options."""
    program, *words = service.command
    if PurePath(program).name != "reconros" or not words or words[0] not in _VERBS:
        raise command.error(
            f"cannot be simulated: {' '.join(service.command)!r}.",
            f"Simulated are `reconros {'`, `reconros '.join(_VERBS)}`; for all else use `reconros up`.",
        )
    verb, *arguments = words
    parser = _parser(verb)
    # An option on the command line wins over a variable: of two values the last one counts.
    variables = [
        f"{parameter.opts[0]}={service.environment[parameter.envvar]}"
        for parameter in parser.params
        if isinstance(parameter.envvar, str) and service.environment.get(parameter.envvar)
    ]
    try:
        given = parser.main([*variables, *arguments], f"reconros {verb}", standalone_mode=False)
    except typer.TyperException as error:
        raise command.error(
            f"cannot be run: {error.format_message().removesuffix('.')}.", f"See `reconros {verb} --help`."
        ) from None
    return verb, given


@functools.cache
def _parser(verb: str) -> Any:
    """Return the command line of a verb, which gives back its options instead of running it."""

    @functools.wraps(_VERBS[verb])
    def options(**given: object) -> dict[str, object]:
        return given

    application = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    application.command(add_help_option=False)(options)
    return get_command(application)


def _check_clients(plan: DeploymentPlan, nodes: Mapping[str, YamlNode]) -> None:
    """Raise FileError for a client, camera or robot that could never begin."""
    waiting: dict[str, ClientOptions | CameraOptions] = {**plan.clients, **plan.cameras}
    asking: dict[str, ClientOptions | CameraOptions | RobotOptions] = {**waiting, **plan.robots}
    for name, each in asking.items():
        if not plan.place(each.domain):
            command = nodes[name].mapping()["command"]
            problem = f"asks in domain {each.domain}, where no board is."
            raise command.error(problem, "Give a board the same --domain.")
    groups: defaultdict[str | None, set[str]] = defaultdict(set)
    for client in plan.clients.values():
        groups[client.group].add(client.name)
    for camera in plan.cameras.values():
        groups[camera.group].add("camera")
    for viewer in plan.viewers.values():
        groups[viewer.group].add("viewer")
    for name, member in waiting.items():
        there = len(groups[member.group])
        if member.group is not None and there < member.members:
            command = nodes[name].mapping()["command"]
            raise command.error(
                f"waits for {member.members} clients of the group {member.group!r}, which has {there}.",
                "Correct --members or add the clients.",
            )


def _check_end(plan: DeploymentPlan, nodes: Mapping[str, YamlNode], *, has_end: bool) -> None:
    """Raise FileError when nothing would ever happen, or it would never end."""
    first = next(iter(nodes.values()))
    if not plan.boards:
        raise first.error("and the others are no boards.", "Add a `reconros board`.")
    if not (has_end or plan.clients or plan.cameras or plan.robots):
        raise first.error(
            "and the others are no clients, with which the simulation would end.",
            "Say with --seconds how long it runs, or add a `reconros client`.",
        )
