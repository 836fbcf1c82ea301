"""Clients that begin together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reconros_zenoh.clock.virtual import succeed_once

if TYPE_CHECKING:
    import simpy

    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.transport.base import Transport


def gather(
    transport: Transport,
    environment: VirtualEnvironment,
    start: simpy.Event,
    group: str | None,
    name: str,
    members: int,
) -> None:
    """Let `start` happen once so many members of the group, this one included, have announced themselves.

    Without a group it happens at once.
    """
    if group is None:
        start.succeed()
        return
    present: set[str] = set()

    def on_change(key: str, alive: bool) -> None:
        # One that has finished and gone was there all the same.
        if alive:
            present.add(key)
        if len(present) >= members:
            environment.post(succeed_once, start)

    prefix = f"reconros/clients/{group}"
    transport.watch_tokens(f"{prefix}/*", on_change)
    transport.declare_token(f"{prefix}/{name}")
