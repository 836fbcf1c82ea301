"""Mapping files: which callback may run in software and in which slots, and which executor runs them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictInt, ValidationError

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.gateway_slots import gateway_slots
from reconros_zenoh.toml_file import UNKNOWN_KEY, TomlFile, first_mistake

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from pathlib import Path

    from reconros_zenoh.project.build_cfg import BuildConfiguration, ReconosThread

_Count = Annotated[StrictInt, Field(ge=0, le=1000)]


class CallbackMapping(BaseModel):
    """Where one callback may run: in software, and in the slots with these ids."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    software: StrictBool = False
    slots: tuple[StrictInt, ...] = ()


class ProjectMapping(BaseModel):
    """A mapping of all callbacks of a project.

    `executor` is the ReconROS executor or the standard multi-threaded one of ROS 2, which knows software
    only. A file that gives no `hardware_workers` has one for each slot, under the standard executor none.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    executor: Literal["reconros", "standard"]
    software_workers: _Count
    hardware_workers: _Count
    callbacks: dict[str, CallbackMapping]

    @classmethod
    def default(cls, configuration: BuildConfiguration) -> Self:
        """Return the mapping of a project without mapping files: what can be in hardware is, all else not.

        A callback gets all reconfigurable slots that it is built for; without any, the first other slot that
        no callback before it has. A gateway's slot is the gateway's. Raise FileError for a callback that has
        no SwSource, and finds all its slots taken.
        """
        reconfigurable = {slot.id for slot in configuration.slots if slot.reconfigurable}
        built = built_for(configuration)
        gateways = gateway_slots(configuration, {})
        taken = {
            gateways[gateway.name]: f"the gateway {gateway.name} (line {gateway.line})"
            for gateway in configuration.gateways
        }
        callbacks: dict[str, CallbackMapping] = {}
        for thread in configuration.threads:
            slots = built[thread.name]
            own = tuple(slot for slot in slots if slot not in taken)
            own = tuple(slot for slot in own if slot in reconfigurable) or own[:1]
            if slots and not own and not thread.software:
                raise _no_place(configuration, thread, taken)
            taken |= {
                slot: f"the callback {thread.name} (line {thread.line})"
                for slot in own
                if slot not in reconfigurable
            }
            callbacks[thread.name] = CallbackMapping(software=not own, slots=own)
        return cls(
            name="default",
            executor="reconros",
            software_workers=2,
            hardware_workers=len(configuration.slots),
            callbacks=callbacks,
        )


def built_for(configuration: BuildConfiguration) -> dict[str, tuple[int, ...]]:
    """Return the ids of the slots that each callback is built for in hardware."""
    return {thread.name: thread.slots if thread.hardware else () for thread in configuration.threads}


def _no_place(
    configuration: BuildConfiguration, thread: ReconosThread, taken: Mapping[int, str]
) -> FileError:
    names = {slot.id: slot.name for slot in configuration.slots}
    holders = " and ".join(f"{names[slot]} is that of {taken[slot]}" for slot in thread.slots)
    return FileError(
        configuration.path,
        thread.line,
        f"The callback {thread.name} has no slot left, and no SwSource: {holders}.",
        "Name another slot for one of them, or give the callback a SwSource.",
    )


def read_mapping(
    path: Path, callbacks: Mapping[str, Collection[int]], slots: Collection[int]
) -> ProjectMapping:
    """Return the mapping in a TOML file, checked against its project.

    `callbacks` are the project's callbacks with the ids of the slots that they are built for, `slots` the ids
    of all slots. `FileError` names the line of the first mistake. Each callback has to be mapped.
    """
    toml = TomlFile.read(path)
    if "name" in toml.content:
        raise FileError(path, toml.line(["name"]), "name: unknown key.", "The file name names the mapping.")
    if path.stem == ".." or not path.stem.isprintable():
        raise FileError(
            path,
            None,
            f"{path.stem!r} cannot name a mapping: folders and drawings have its name.",
            "Rename the file.",
        )
    one_per_slot = 0 if toml.content.get("executor") == "standard" else len(slots)
    try:
        mapping = ProjectMapping.model_validate(
            {"name": path.stem, "hardware_workers": one_per_slot, **toml.content}
        )
    except ValidationError as error:
        raise _schema_error(toml, error) from None
    _check_workers(toml, mapping, slots)
    for name in mapping.callbacks:
        if name not in callbacks:
            raise FileError(
                path,
                toml.line(["callbacks", name]),
                f"The project has no callback {name!r}.",
                f"Its callbacks: {', '.join(callbacks)}.",
            )
        _check_callback(toml, mapping, name, slots, callbacks[name])
    missing = [name for name in callbacks if name not in mapping.callbacks]
    if missing:
        raise FileError(
            path,
            None,
            f"The callback {missing[0]!r} of the project is not mapped.",
            f"Add `[callbacks.{missing[0]}]` with `software = true` or `slots = [...]`.",
        )
    return mapping


def _check_workers(toml: TomlFile, mapping: ProjectMapping, slots: Collection[int]) -> None:
    if mapping.hardware_workers > len(slots):
        raise FileError(
            toml.path,
            toml.line(["hardware_workers"]),
            f"hardware_workers = {mapping.hardware_workers} is more than the slots of the project: "
            f"{len(slots)}.",
            "Give at most one for each slot.",
        )
    if mapping.hardware_workers and mapping.executor == "standard":
        raise FileError(
            toml.path,
            toml.line(["hardware_workers"]),
            "The standard executor has no hardware workers.",
            'Use `executor = "reconros"` or take them away.',
        )


def _check_callback(
    toml: TomlFile, mapping: ProjectMapping, name: str, slots: Collection[int], built_for: Collection[int]
) -> None:
    callback = mapping.callbacks[name]

    def error(key: list[str], problem: str, remedy: str) -> FileError:
        return FileError(toml.path, toml.line(["callbacks", name, *key]), problem, remedy)

    if not callback.software and not callback.slots:
        raise error(
            [], f"The callback {name} is mapped to no place.", "Set `software = true` or list its `slots`."
        )
    unknown = [slot for slot in callback.slots if slot not in slots]
    if unknown:
        raise error(
            ["slots"],
            f"The callback {name} is mapped to the unknown slot {unknown[0]}.",
            f"Known slots: {', '.join(map(str, slots)) or 'none'}.",
        )
    unbuilt = [slot for slot in callback.slots if slot not in built_for]
    if unbuilt:
        raise error(
            ["slots"],
            f"The callback {name} is mapped to slot {unbuilt[0]}, which its thread is not built for.",
            f"It is built for: {', '.join(map(str, built_for)) or 'none'}; see HwSource and Slot of "
            f"[ReconosThread@{name}] in build.cfg.",
        )
    if callback.slots and mapping.executor == "standard":
        raise error(
            ["slots"],
            f"The callback {name} is mapped to slots, but the standard executor knows only software.",
            'Use `executor = "reconros"` or take the slots away.',
        )
    served = sorted(slots)[: mapping.hardware_workers]
    unserved = [slot for slot in callback.slots if slot not in served]
    if unserved:
        raise error(
            ["slots"],
            f"The callback {name} is mapped to slot {unserved[0]}, which no hardware worker serves; "
            f"they serve {', '.join(map(str, served)) or 'none'}.",
            "Raise `hardware_workers`.",
        )
    if callback.software and mapping.software_workers == 0:
        raise error(
            ["software"],
            f"The callback {name} is mapped to software, but there are 0 software workers.",
            "Raise `software_workers`.",
        )


def _schema_error(toml: TomlFile, error: ValidationError) -> FileError:
    first = first_mistake(error)
    place = [str(key) for key in first["loc"]]
    if first["type"] == UNKNOWN_KEY:
        known = (
            CallbackMapping.model_fields if len(place) > 1 else ProjectMapping.model_fields.keys() - {"name"}
        )
        return FileError(
            toml.path,
            toml.line(place),
            f"{'.'.join(place)}: unknown key.",
            f"Known keys: {', '.join(sorted(known))}.",
        )
    return FileError(
        toml.path,
        toml.line(place),
        f"{'.'.join(place)}: {first['msg'].replace('tuple', 'list')}.",
        "Correct the value or add the key.",
    )
