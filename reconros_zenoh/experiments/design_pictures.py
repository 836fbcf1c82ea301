"""The pictures of the design example for its report: what went in, beside what came out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

from reconros_zenoh.applications.design_example.picture import moving_picture

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from reconros_zenoh.experiments.design import DesignPlan
    from reconros_zenoh.measure.design_report import Picture


def pictures_of(plan: DesignPlan, variants: Iterable[str]) -> dict[str, list[Picture]]:
    """Return for each variant the first and the last picture that came back, each behind what was sent."""
    return {variant: _pictures(plan.variant_folder(variant)) for variant in variants}


def _pictures(folder: Path) -> list[Picture]:
    lines = (folder / "filter.csv").read_text(encoding="utf-8").splitlines()[1:]
    numbers = [int(line.split(",")[0]) for line in lines if not line.endswith("lost")]
    if not numbers or not (folder / "last.png").exists():  # a viewer that was killed leaves none
        return []
    shown: list[Picture] = []
    for name, number in (("first", numbers[0]), ("last", numbers[-1])):
        _, png = cv2.imencode(".png", moving_picture(number))
        shown.append((f"picture {number} as the camera took it", png.tobytes()))
        shown.append((f"picture {number} filtered", (folder / f"{name}.png").read_bytes()))
    return shown
