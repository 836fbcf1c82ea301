"""Which profile stands for the board that a project is built for."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from reconros_zenoh.board.profile import profile_names

if TYPE_CHECKING:
    from reconros_zenoh.project.build_cfg import BuildConfiguration

_log = logging.getLogger(__name__)

# The beginning of TargetPart, and the profile of a board with that part.
_PARTS = {"xc7z100": "miniitx-zynq7100", "xczu7ev": "zcu104"}


def target_profile(configuration: BuildConfiguration) -> str:
    """Return the name of the shipped profile that stands for TargetBoard or TargetPart.

    It is `native` where there is none, with a warning if the project names a board.
    """
    board = configuration.board
    names = [] if board is None else [f"{board.board}-{board.revision}", board.board]
    part = (configuration.part or "").lower()
    names += [profile for prefix, profile in _PARTS.items() if part.startswith(prefix)]
    shipped = profile_names()
    found = next((name for name in names if name in shipped), None)
    if found is None and (board or part):
        _log.warning(
            "there is no profile for the board of %s: it runs on native, which models nothing. "
            "Choose one with --profile.",
            configuration.path,
        )
    return found or "native"
