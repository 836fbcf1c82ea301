"""Mapping files: which callback may run in software and in which slots, and which executor runs them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictInt, ValidationError

from reconros_zenoh.errors import FileError
from reconros_zenoh.toml_file import TomlFile

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

_Count = Annotated[StrictInt, Field(ge=0)]


class CallbackMapping(BaseModel):
    """Where one callback may run: in software, and in the slots with these ids."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    software: StrictBool = False
    slots: tuple[StrictInt, ...] = ()


class Mapping(BaseModel):
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


def read_mapping(path: Path, callbacks: Collection[str], slots: Collection[int]) -> Mapping:
    """Return the mapping in a TOML file, checked against the callbacks and the slot ids of its project.

    `FileError` names the line of the first mistake. Each callback of the project has to be mapped.
    """
    toml = TomlFile.read(path)
    if "name" in toml.content:
        raise FileError(path, toml.line(["name"]), "name: unknown key.", "The file name names the mapping.")
    one_per_slot = 0 if toml.content.get("executor") == "standard" else len(slots)
    try:
        mapping = Mapping.model_validate(
            {"name": path.stem, "hardware_workers": one_per_slot, **toml.content}
        )
    except ValidationError as error:
        raise _schema_error(toml, error) from None
    for name, callback in mapping.callbacks.items():
        if name not in callbacks:
            raise FileError(
                path,
                toml.line(["callbacks", name]),
                f"The project has no callback {name!r}.",
                f"Its callbacks: {', '.join(callbacks)}.",
            )
        _check_callback(toml, mapping, name, callback, slots)
    missing = [name for name in callbacks if name not in mapping.callbacks]
    if missing:
        raise FileError(
            path,
            None,
            f"The callback {missing[0]!r} of the project is not mapped.",
            f"Add `[callbacks.{missing[0]}]` with `software = true` or `slots = [...]`.",
        )
    return mapping


def _check_callback(
    toml: TomlFile, mapping: Mapping, name: str, callback: CallbackMapping, slots: Collection[int]
) -> None:
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
    if callback.slots and mapping.executor == "standard":
        raise error(
            ["slots"],
            f"The callback {name} is mapped to slots, but the standard executor knows only software.",
            'Use `executor = "reconros"` or take the slots away.',
        )
    if callback.slots and mapping.hardware_workers == 0:
        raise error(
            ["slots"],
            f"The callback {name} is mapped to slots, but there are 0 hardware workers.",
            "Raise `hardware_workers`.",
        )
    if callback.software and mapping.software_workers == 0:
        raise error(
            ["software"],
            f"The callback {name} is mapped to software, but there are 0 software workers.",
            "Raise `software_workers`.",
        )


def _schema_error(toml: TomlFile, error: ValidationError) -> FileError:
    first = error.errors()[0]
    place = [str(key) for key in first["loc"]]
    if first["type"] == "extra_forbidden":
        known = CallbackMapping.model_fields if len(place) > 1 else Mapping.model_fields.keys() - {"name"}
        return FileError(
            toml.path,
            toml.line(place),
            f"{'.'.join(place)}: unknown key.",
            f"Known keys: {', '.join(sorted(known))}.",
        )
    return FileError(
        toml.path,
        toml.line(place),
        f"{'.'.join(place)}: {first['msg']}.",
        "Correct the value or add the key.",
    )
