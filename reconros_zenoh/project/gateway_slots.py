"""Which slot each gateway of a project has for itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from reconros_zenoh.project.build_cfg import BuildConfiguration, RosGateway


def gateway_slots(
    configuration: BuildConfiguration, callbacks: Mapping[str, Collection[int]]
) -> dict[str, int]:
    """Return the id of the slot that each gateway has for itself: one that no callback is mapped to.

    `callbacks` are the ids of the slots that each callback is mapped to.
    Of the slots that a gateway can be built for it is the first, if possible one that no thread is built for;
    gateways with few of them choose first. One that finds them taken lets another gateway move, so that as
    many as possible have one (a maximum matching by augmenting paths). Raise FileError at the line of the
    first gateway that none is left for, naming all of them.
    """
    threads = {slot for thread in configuration.threads if thread.hardware for slot in thread.slots}
    tenants = {slot: f"the callback {name}" for name, slots in callbacks.items() for slot in slots}
    holders: dict[int, RosGateway] = {}

    def seat(gateway: RosGateway, asked: set[int]) -> bool:
        own = [slot for slot in gateway.slots if slot not in tenants]
        for slot in sorted(own, key=lambda slot: (slot in holders, slot in threads)):
            if slot not in asked:
                asked.add(slot)
                if slot not in holders or seat(holders[slot], asked):
                    holders[slot] = gateway
                    return True
        return False

    for gateway in sorted(configuration.gateways, key=lambda gateway: len(gateway.slots)):
        seat(gateway, set())
    left = [gateway for gateway in configuration.gateways if gateway not in holders.values()]
    if left:
        tenants.update((slot, f"the gateway {gateway.name}") for slot, gateway in holders.items())
        raise FileError(
            configuration.path,
            left[0].line,
            " ".join(_without_slot(gateway, tenants) for gateway in left),
            "Name another one there.",
        )
    return {gateway.name: slot for slot, gateway in holders.items()}


def _without_slot(gateway: RosGateway, tenants: Mapping[int, str]) -> str:
    others = " and ".join(dict.fromkeys(tenants[slot] for slot in gateway.slots))
    named = f"only those of {others}" if others else "none"
    return f"The gateway {gateway.name} has no slot for itself: its Slot names {named}."
