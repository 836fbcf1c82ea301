"""Reading a ReconROS project: a folder with build.cfg, main.py, callbacks and interfaces."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from reconros_zenoh.board.bitstream import Bitstream
from reconros_zenoh.board.board import SlotPlan
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.communication import check_fifos, check_places, check_topics
from reconros_zenoh.project.interfaces import read_interfaces
from reconros_zenoh.project.main_file import load_main, running_project
from reconros_zenoh.project.mapping_file import ProjectMapping, built_for, read_mapping
from reconros_zenoh.project.resources import resources_by_slot
from reconros_zenoh.project.target import target_profile
from reconros_zenoh.text_file import read_text_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.project.application import Application
    from reconros_zenoh.project.build_cfg import BuildConfiguration
    from reconros_zenoh.project.interfaces import Interfaces
    from reconros_zenoh.ros.type_registry import TypeRegistry

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProjectFiles:
    """A project folder as read, but for its Python."""

    folder: Path
    configuration: BuildConfiguration
    interfaces: Interfaces

    @property
    def callbacks(self) -> tuple[str, ...]:
        """The names of the callbacks, in the order of the file."""
        return tuple(thread.name for thread in self.configuration.threads)

    @property
    def slots(self) -> tuple[SlotPlan, ...]:
        """The slots with the resources of their regions and their clocks."""
        clocks = {clock.name: clock.hz for clock in self.configuration.clocks}
        resources_of = resources_by_slot(self.configuration.slots)
        return tuple(
            SlotPlan(
                slot.id,
                resources.lut,
                resources.dsp,
                resources.bram36,
                clocks[slot.clock] if slot.clock else None,
                slot.reconfigurable,
            )
            for slot in self.configuration.slots
            for resources in [resources_of[slot.id]]
        )

    @property
    def pointer_bytes(self) -> int:
        """The size of a pointer on the board's processor."""
        return 8 if "64" in self.configuration.cpu_architecture else 4

    def types(self) -> TypeRegistry:
        """Return the registry that knows the project's interfaces, the same one each time."""
        return self._types

    @cached_property
    def _types(self) -> TypeRegistry:
        return self.interfaces.registry()

    def profile(self, name_or_file: str | Path | None) -> Profile:
        """Return the profile of that name or in that file; None stands for that of the project's board.

        See `target_profile`.
        """
        return read_profile(name_or_file) if name_or_file else self._profile

    @cached_property
    def _profile(self) -> Profile:
        return read_profile(target_profile(self.configuration))

    def mapping(self, name_or_file: str | Path | None) -> ProjectMapping:
        """Return the mapping of that name in the project's folder `mappings`, or the one in that file.

        None stands for the first in the folder, or, if there is none, for the default.
        """
        name_or_file = name_or_file or next(iter(self.mapping_files()), None)
        if name_or_file is None:
            mapping = ProjectMapping.default(self.configuration)
        else:
            mapping = read_mapping(
                self.mapping_path(name_or_file),
                built_for(self.configuration),
                [slot.slot_id for slot in self.slots],
            )
        check_places(self.configuration, mapping.callbacks)
        return mapping

    def log_warnings(self) -> None:
        """Log the warnings of build.cfg: what was left out there shows as mistakes elsewhere."""
        for warning in self.configuration.warnings:
            _log.warning("%s", warning)

    @contextmanager
    def with_its_causes(self) -> Iterator[None]:
        """Log the warnings if what is done within it is refused."""
        try:
            yield
        except FileError:
            self.log_warnings()
            raise

    def mappings(self, names_or_files: Sequence[str | None]) -> dict[str, ProjectMapping]:
        """Return these mappings by name, each as `mapping` does; raise UsageError for two of one name."""
        mappings: dict[str, ProjectMapping] = {}
        for name_or_file in names_or_files:
            mapping = self.mapping(name_or_file)
            if mapping.name in mappings:
                raise UsageError(f"two mappings are named {mapping.name!r}. Give it once, or rename a file.")
            mappings[mapping.name] = mapping
        return mappings

    def unusable_mappings(self) -> dict[Path, FileError]:
        """Return those of the mapping files that the project refuses, each with why.

        Without mapping files the default counts as one, of the name of build.cfg.
        """
        refused = {}
        default = None, self.configuration.path
        for name, path in (*self.mapping_files().items(),) or (default,):
            try:
                self.mapping(name)
            except FileError as error:
                refused[path] = error
        return refused

    def mapping_path(self, name_or_file: str | Path) -> Path:
        """Return where the mapping stands; raise UsageError when there is none of that name."""
        shipped, given = self.mapping_files(), str(name_or_file)
        if given in shipped:
            return shipped[given]
        path = Path(given)
        if path.suffix != ".toml":
            known = f"one of {', '.join(shipped)} or " if shipped else ""
            raise UsageError(f"no mapping named {given!r}. Give {known}a .toml file.")
        return path

    def mapping_files(self) -> dict[str, Path]:
        """Return the mapping files in the project's folder `mappings` by name, in the order of the names."""
        return {path.stem: path for path in sorted((self.folder / "mappings").glob("*.toml"))}

    def bitstreams(self, profile: Profile) -> list[Bitstream]:
        """Return the bitstream of each callback for each reconfigurable slot that it is built for."""
        sizes = {
            slot.slot_id: profile.bitstream_size(slot.lut, slot.dsp, slot.bram36)
            for slot in self.slots
            if slot.reconfigurable
        }
        return [
            Bitstream(slot, callback, sizes[slot])
            for callback, slots in built_for(self.configuration).items()
            for slot in slots
            if slot in sizes
        ]


@dataclass(frozen=True)
class Project(ProjectFiles):
    """A project folder as read; `main` is the function of that name in its main.py."""

    main: Callable[[Application], None]

    def start(self, application: Application) -> Executor:
        """Call main(app) and return the executor that it spins.

        Raises FileError, with the line, for what goes wrong in the project's Python, for a callback that the
        mapping places and that it does not add, and for one that it adds but build.cfg does not have.
        """
        with running_project(self.folder):
            self.main(application)
        path = self.folder / "main.py"
        executor = application.executor
        if executor is None:
            raise FileError(path, None, "main(app) does not call app.spin().", "Call it last.")
        added = executor.statistics()
        for thread in self.configuration.threads:
            place = application.mapping.callbacks[thread.name]
            if (place.software or place.slots) and thread.name not in added:
                raise FileError(
                    self.configuration.path,
                    thread.line,
                    f"{path} adds no callback {thread.name!r}.",
                    f'Add `app.register("{thread.name}", ...)` there, or take the section away.',
                )
        for name in added:
            if name not in self.callbacks:
                raise FileError(
                    path,
                    _line_that_names(path, name),
                    f"The callback {name!r} is not in build.cfg.",
                    f"Add a section `[ReconosThread@{name}]` there.",
                )
        return executor


def read_project(folder: Path) -> ProjectFiles:
    """Return the files of the project in a folder; raise FileError for what is missing or wrong in them."""
    if folder.is_file():
        raise FileError(folder, None, "is a file.", "Give the folder of a project, where its build.cfg is.")
    if not folder.exists():
        raise FileError(
            folder,
            None,
            "is not there.",
            f"Give the folder of a project; relative paths, in a Compose file too, count from {Path.cwd()}.",
        )
    configuration = check_topics(read_build_cfg(folder / "build.cfg"))
    files = ProjectFiles(folder, configuration, read_interfaces(folder))
    check_fifos(configuration, files.types)
    return files


def load_project(folder: Path) -> Project:
    """Return the project in a folder and log its warnings; raise FileError for what is missing or wrong."""
    files = read_project(folder)
    files.log_warnings()
    main = load_main(folder, files.configuration.name)
    return Project(folder, files.configuration, files.interfaces, main)


def _line_that_names(path: Path, name: str) -> int | None:
    lines = enumerate(read_text_file(path).split("\n"), start=1)
    return next((number for number, line in lines if f'"{name}"' in line or f"'{name}'" in line), None)
