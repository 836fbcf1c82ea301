"""The slots for hardware threads: their sections and the lists that name them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

from reconros_zenoh.project.clocks import read_clock_name
from reconros_zenoh.project.regions import read_regions

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from reconros_zenoh.project.ini import Section
    from reconros_zenoh.project.regions import Region

REGION_OPTION = re.compile(r"Region_?([0-9]{1,9})")


@dataclass(frozen=True)
class HwSlot:
    """A slot for hardware threads, named `name(number)`; `regions` is empty where the file gives none."""

    id: int
    name: str
    clock: str | None
    reconfigurable: bool
    regions: tuple[Region, ...]
    ports: str | None
    line: int


def read_slots(
    sections: Iterable[Section],
    clocks: Collection[str],
    warnings: list[str],
    *,
    partial_reconfiguration: bool,
) -> list[HwSlot]:
    """Return the slots of all `[HwSlot@name(a:b)]` sections.

    The first slot of a range has the number `Id`, the others count on from it. With partial reconfiguration
    each reconfigurable slot needs a region; one that overlaps with that of another slot is warned of.
    """
    slots: list[HwSlot] = []
    for section in sections:
        for slot in _slots_of(section, clocks, warnings, partial_reconfiguration=partial_reconfiguration):
            twin = next((other for other in slots if slot.id == other.id or slot.name == other.name), None)
            if twin is not None:
                raise section.error(
                    f"{slot.name} (Id {slot.id}) and {twin.name} (Id {twin.id}) of line {twin.line} overlap.",
                    "Give each slot a name and an Id of its own; Id is that of the first slot of a range.",
                )
            warnings += _overlap(section, slot, slots)
            slots.append(slot)
    return slots


def _overlap(section: Section, slot: HwSlot, others: Iterable[HwSlot]) -> Iterator[str]:
    """Yield a warning, no error because synthesis decides, if another slot has sites of this one."""
    for other in others:
        for own, theirs in product(slot.regions, other.regions):
            if own.overlaps(theirs):
                yield (
                    f"{section.path}:{own.line}: {own} of {slot.name} overlaps {theirs} of {other.name} in "
                    f"line {theirs.line}. Give each site to one slot."
                )
                return


def _slots_of(
    section: Section, clocks: Collection[str], warnings: list[str], *, partial_reconfiguration: bool
) -> Iterator[HwSlot]:
    label = section.numbered_label()
    if label.numbers is None:
        raise section.error(f"{section} gives no range of slots.", "Write `[HwSlot@slot(0:3)]`.")
    first_id = section.number("Id")
    clock = read_clock_name(section, "Clock", clocks)
    reconfigurable = section.boolean("Reconfigurable", default=False)
    regions = _regions_of(section, label.numbers, warnings)
    for offset, number in enumerate(label.numbers):
        name = f"{label.name}({number})"
        if reconfigurable and partial_reconfiguration and not regions.get(number):
            raise section.error(
                f"The reconfigurable slot {name} has no region.", f"Add `Region_{number} = ...`."
            )
        yield HwSlot(
            id=first_id + offset,
            name=name,
            clock=clock,
            reconfigurable=reconfigurable,
            regions=regions.get(number, ()),
            ports=section.value("Ports"),
            line=section.line,
        )


def _regions_of(section: Section, numbers: range, warnings: list[str]) -> dict[int, tuple[Region, ...]]:
    """Return the regions by the number of the slot; `Region_n` counts as the slots do, or from 0."""
    written = [
        (int(match[1]), option)
        for name, option in section.options.items()
        if (match := REGION_OPTION.fullmatch(name))
    ]
    start = numbers.start if any(number == 0 for number, _ in written) else 0
    regions: dict[int, tuple[Region, ...]] = {}
    for number, option in written:
        if start + number in regions:
            raise option.error(
                f"{option.name} is the second region of its slot.",
                "Write one region for each slot of the range.",
            )
        if start + number not in numbers:
            warnings.append(
                f"{option.path}:{option.line}: {option.name} belongs to no slot of {section} and is left out."
            )
            continue
        regions[start + number] = read_regions(option)
    return regions


def read_slot_ids(section: Section, slots: Collection[HwSlot], warnings: list[str]) -> tuple[int, ...]:
    """Return the ids of the slots that the option `Slot` lists, each once; `slot(*)` is all of that name."""
    option = section.options.get("Slot")
    if option is None:
        return ()
    remedy = f"Known slots: {', '.join(slot.name for slot in slots) or 'none'}."
    ids = {slot.name: slot.id for slot in slots}
    listed: list[int] = []
    for entry in option.numbered_names(remedy):
        if entry.every:
            wanted = [name for name in ids if name.rpartition("(")[0] == entry.name]
        else:
            wanted = [f"{entry.name}({number})" for number in entry.numbers or ()]
        unknown = [name for name in wanted if name not in ids]
        if entry.every and not wanted:
            warnings.append(f"{option.path}:{option.line}: {section}: there is no slot named {entry.name}.")
        elif unknown or not wanted:
            raise option.error(
                f"{section} names the unknown slot {', '.join(unknown) or entry.name}.", remedy
            )
        listed += [ids[name] for name in wanted]
    return tuple(dict.fromkeys(listed))
