"""Which profile stands for the board that a project is built for."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

    from reconros_zenoh.project.build_cfg import BuildConfiguration

# The beginning of TargetPart, and the profile of a board with that part.
_PARTS = {"xc7z100": "miniitx-zynq7100", "xczu7ev": "zcu104"}


def target_profile(configuration: BuildConfiguration, profiles: Collection[str]) -> str | None:
    """Return the name among `profiles` that stands for TargetBoard or TargetPart, None if there is none."""
    board = configuration.board
    names = [] if board is None else [f"{board.board}-{board.revision}", board.board]
    part = (configuration.part or "").lower()
    names += [profile for prefix, profile in _PARTS.items() if part.startswith(prefix)]
    return next((name for name in names if name in profiles), None)
