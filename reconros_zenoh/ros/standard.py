"""The interfaces of ROS 2 Jazzy that rosbags does not bring; `interfaces/README.md` tells their source."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable


@cache
def standard_interfaces() -> dict[str, Traversable]:
    """Return their files by name (`std_srvs/srv/SetBool`)."""
    return {
        f"{package.name}/{kind.name}/{file.name.removesuffix(f'.{kind.name}')}": file
        for package in (resources.files("reconros_zenoh.ros") / "interfaces").iterdir()
        if package.is_dir()
        for kind in package.iterdir()
        for file in kind.iterdir()
    }
