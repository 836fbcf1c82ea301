"""The design example in wall time: router, boards, camera and viewer as processes of a deployment."""

from __future__ import annotations

import os
import uuid
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

from deploy.compose import read_compose
from deploy.runner import LocalRunner
from reconros_zenoh.board.control import ask_status
from reconros_zenoh.experiments.design import RATE_HZ, VARIANTS, projects_folder
from reconros_zenoh.experiments.wall import free_port
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.experiments.design import DesignPlan


def run_design_wall(
    plan: DesignPlan, on_variant: Callable[[], None], view: int | None
) -> dict[str, dict[str, Any]]:
    """Record each variant and return the status of the board `vision` at its end.

    `on_variant()` is called after each of them; `view` is the port of the viewer's page. Raise
    ExperimentError, naming the process and with the end of its log, when one fails; nothing is left running.
    """
    statuses = {}
    with as_file(files("deploy") / "design_example.yaml") as compose:
        for variant in VARIANTS:
            router = f"tcp/127.0.0.1:{free_port()}"
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
                runner.run_until({"camera"})
                with ZenohTransport.open(router) as transport:
                    statuses[variant] = ask_status(transport, "vision")
            on_variant()
    return statuses
