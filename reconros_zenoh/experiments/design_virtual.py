"""The design example in virtual time: boards and desktop in one process."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

from host_clients.camera import CameraOptions
from host_clients.gallery import Gallery
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.board.status import status
from reconros_zenoh.experiments.design import RATE_HZ, VARIANTS, Ending, projects_folder
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.measure.record import RecordWriter
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconros_zenoh.experiments.design import DesignPlan


def run_design_virtual(plan: DesignPlan, endings: dict[str, Ending], on_variant: Callable[[], None]) -> None:
    """Record each variant and add its end to `endings`, that of an interrupted one too.

    `on_variant()` is called after each of them.
    """
    for variant in VARIANTS:
        _run_variant(plan, variant, endings)
        on_variant()


def _run_variant(plan: DesignPlan, variant: str, endings: dict[str, Ending]) -> None:
    profile = read_profile(plan.profile)
    vision, control = (load_project(projects_folder() / name) for name in ("vision", "control"))
    folder = plan.variant_folder(variant)
    gallery = Gallery()
    with Simulation(vision.types()) as simulation, ExitStack() as records:
        hosted = simulation.add_board(
            profile, vision, vision.mapping(variant), BoardOptions("vision", seed=plan.seed)
        )
        simulation.add_board(
            profile, control, control.mapping("software"), BoardOptions("control", seed=plan.seed)
        )
        pictures, indices = (
            records.enter_context(RecordWriter(folder / f"{name}.csv")) for name in ("filter", "control")
        )
        simulation.add_viewer(0, pictures.write, indices.write, gallery.add)
        camera = simulation.add_camera(CameraOptions(plan.pictures, RATE_HZ))
        try:
            simulation.run()
        finally:
            gallery.write(folder, RATE_HZ)
            endings[variant] = Ending(status(hosted.board, hosted.executor), camera.sent)
