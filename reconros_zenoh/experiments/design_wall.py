"""The design example in wall time: router, boards, camera and viewer as processes of a deployment."""

from __future__ import annotations

import os
import uuid
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

from deploy.compose import read_compose
from deploy.runner import LocalRunner
from deploy.service_run import ServiceState
from reconros_zenoh.board.control import ask_status
from reconros_zenoh.experiments.design import RATE_HZ, VARIANTS, Ending, projects_folder
from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.experiments.design import DesignPlan


def run_design_wall(
    plan: DesignPlan, endings: dict[str, Ending], on_variant: Callable[[], None], view: int | None
) -> None:
    """Record each variant and add its end to `endings`, that of one interrupted while the camera ran too.

    `on_variant()` is called after each of them; `view` is the port of the viewer's page. Raise
    ExperimentError, naming the process and with the end of its log, when one fails; nothing is left running.
    """
    with as_file(files("deploy") / "design_example.yaml") as compose:
        for variant in VARIANTS:
            router = free_endpoint()
            folder = plan.variant_folder(variant).resolve()
            environment = {
                **os.environ,
                "ROUTER": router,
                "LISTEN": router,
                "PROFILE": plan.profile,
                "PROJECTS": str(projects_folder()),
                "MAPPING": variant,
                "PICTURES": str(plan.pictures),
                "RATE": str(RATE_HZ),
                "SEED": str(plan.seed),
                "GROUP": uuid.uuid4().hex,
                "VIEW": "" if view is None else str(view),
                "OUT": str(folder),
            }
            deployment = read_compose(compose, environment)
            # The viewer writes its pictures when it is stopped, at the end of the context.
            with LocalRunner(deployment, folder / "logs", environment) as runner:
                try:
                    runner.run_until({"camera"})
                    endings[variant] = Ending(_status(router), plan.pictures)
                except (KeyboardInterrupt, SystemExit):
                    if runner.states["camera"] is ServiceState.STARTED:
                        endings[variant] = Ending(_status(router), None)
                    raise
            on_variant()


def _status(router: str) -> dict[str, Any]:
    with ZenohTransport.open(router) as transport:
        return ask_status(transport, "vision")
