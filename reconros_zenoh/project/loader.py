"""Reading a ReconROS project: a folder with build.cfg, main.py, callbacks and interfaces."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.board.board import SlotPlan
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.communication import check_places, check_topics
from reconros_zenoh.project.interfaces import read_interfaces
from reconros_zenoh.project.mapping_file import read_mapping
from reconros_zenoh.project.resources import slot_resources
from reconros_zenoh.ros.types import TypeRegistry

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.project.application import Application
    from reconros_zenoh.project.build_cfg import BuildConfiguration
    from reconros_zenoh.project.interfaces import Interfaces
    from reconros_zenoh.project.mapping_file import Mapping


@dataclass(frozen=True)
class Project:
    """A project folder as read; `main` is the function of that name in its main.py."""

    folder: Path
    configuration: BuildConfiguration
    interfaces: Interfaces
    main: Callable[[Application], None]

    @property
    def callbacks(self) -> tuple[str, ...]:
        """The names of the callbacks, in the order of the file."""
        return tuple(thread.name for thread in self.configuration.threads)

    @property
    def slots(self) -> tuple[SlotPlan, ...]:
        """The reconfigurable slots with the resources of their regions."""
        return tuple(
            SlotPlan(slot.id, resources.lut, resources.dsp, resources.bram36)
            for slot in self.configuration.slots
            if slot.reconfigurable
            for resources in [slot_resources(slot.regions)]
        )

    def types(self) -> TypeRegistry:
        """Return the registry that knows the project's interfaces, the same one each time."""
        return self._types

    @cached_property
    def _types(self) -> TypeRegistry:
        registry = TypeRegistry()
        for name, text in self.interfaces.texts.items():
            (registry.add_service if "/srv/" in name else registry.add_message)(name, text)
        return registry

    def mapping(self, name_or_file: str) -> Mapping:
        """Return the mapping of that name in the project's folder `mappings`, or the one in that file."""
        mapping = read_mapping(
            self.mapping_path(name_or_file), self.callbacks, [slot.slot_id for slot in self.slots]
        )
        check_places(self.configuration, mapping.callbacks)
        return mapping

    def mapping_path(self, name_or_file: str) -> Path:
        """Return where the mapping stands; raise UsageError when there is none of that name."""
        shipped = {path.stem: path for path in sorted((self.folder / "mappings").glob("*.toml"))}
        if name_or_file in shipped:
            return shipped[name_or_file]
        path = type(self.folder)(name_or_file)
        if path.suffix != ".toml":
            raise UsageError(
                f"no mapping named {name_or_file!r}. Give one of {', '.join(shipped)} or a .toml file."
            )
        return path

    def bitstreams(self, profile: Profile) -> list[Bitstream]:
        """Return the bitstream of each callback for each slot it can be built for."""
        sizes = {slot.slot_id: profile.bitstream_size(slot.lut, slot.dsp, slot.bram36) for slot in self.slots}
        return [
            Bitstream(slot, thread.name, sizes[slot])
            for thread in self.configuration.threads
            if thread.hardware is not None
            for slot in thread.slots
            if slot in sizes
        ]


def load_project(folder: Path) -> Project:
    """Return the project in a folder; raise FileError for what is missing or wrong in it."""
    configuration = read_build_cfg(folder / "build.cfg")
    check_topics(configuration)
    interfaces = read_interfaces(folder)
    path = folder / "main.py"
    if not path.is_file():
        raise FileError(path, None, "is missing.", "Write a main.py with a function `main(app)`.")
    spec = importlib.util.spec_from_file_location(f"reconros_project_{configuration.name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise FileError(path, _line_of(error, path), f"{type(error).__name__}: {error}.") from error
    main = getattr(module, "main", None)
    if not callable(main):
        raise FileError(path, None, "has no function `main`.", "Write `def main(app): ...`.")
    return Project(folder, configuration, interfaces, main)


def _line_of(error: BaseException, path: Path) -> int | None:
    """Return the line of the file in which the error was raised."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return error.lineno
    line = None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    return line
