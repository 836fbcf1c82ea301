"""The state machine of the gateway core (Gateways, Section 3, Fig. 4).

The core is a node in hardware. Its one delegate thread either blocks until the software-mapped topic (SMT)
has a message or does something else for the core, never both: to publish, the core has to cancel its request
first. A message that came to the delegate between request and cancel comes back with the cancel, and is
forwarded like any other.

The figure is lost; the text leaves open whether the message that came with the cancel is forwarded before or
after the publication. It is forwarded after: the publication is complete in main memory, others wait for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Any, TypeAlias


class Phase(Enum):
    """What the core waits for."""

    STARTING = auto()  # the location of its output message
    POLLING = auto()  # an answer to its request on the OSIF, or a message on the HMT
    TO_HMT = auto()  # the end of a transfer from main memory to the HMT
    TO_MEMORY = auto()  # the end of a transfer from the HMT to main memory
    CANCELLING = auto()  # the delegate to let go of the request
    PUBLISHING = auto()  # the delegate to publish


@dataclass(frozen=True, slots=True)
class State:
    """Where the core stands; `outgoing` is on its way to the SMT, `late` came with the cancel."""

    phase: Phase = Phase.STARTING
    outgoing: Any = None
    late: Any = None


@dataclass(frozen=True, slots=True)
class Started:
    """The delegate has told the location of the output message."""


@dataclass(frozen=True, slots=True)
class Responded:
    """The delegate has answered the request: the SMT has a message."""

    message: Any


@dataclass(frozen=True, slots=True)
class Arrived:
    """The HMT has a message; it is only polled for in phase POLLING."""

    message: Any


@dataclass(frozen=True, slots=True)
class Transferred:
    """The transfer is complete."""


@dataclass(frozen=True, slots=True)
class Cancelled:
    """The delegate has let go of the request; `message` is what it had got by then, None for nothing."""

    message: Any


@dataclass(frozen=True, slots=True)
class Published:
    """The delegate has published."""


@dataclass(frozen=True, slots=True)
class Request:
    """Ask the delegate for the next message of the SMT."""


@dataclass(frozen=True, slots=True)
class WriteHmt:
    """Transfer the message from main memory to the HMT."""

    message: Any


@dataclass(frozen=True, slots=True)
class WriteMemory:
    """Transfer the message from the HMT to the output message in main memory."""

    message: Any


@dataclass(frozen=True, slots=True)
class Cancel:
    """Take the request back."""


@dataclass(frozen=True, slots=True)
class Publish:
    """Have the delegate publish the output message on the SMT."""

    message: Any


Event: TypeAlias = Started | Responded | Arrived | Transferred | Cancelled | Published
Action: TypeAlias = Request | WriteHmt | WriteMemory | Cancel | Publish


def step(state: State, event: Event) -> tuple[State, Action]:
    """Return the state after the event and what the core does next.

    Raise ValueError for an event that the phase does not wait for.
    """
    match state.phase, event:
        case (Phase.STARTING, Started()) | (Phase.TO_HMT, Transferred()):
            return _request()
        case Phase.POLLING, Responded(message):
            return _forward(message)
        case Phase.POLLING, Arrived(message):
            return State(Phase.TO_MEMORY, outgoing=message), WriteMemory(message)
        case Phase.TO_MEMORY, Transferred():
            return replace(state, phase=Phase.CANCELLING), Cancel()
        case Phase.CANCELLING, Cancelled(message):
            return replace(state, phase=Phase.PUBLISHING, late=message), Publish(state.outgoing)
        case Phase.PUBLISHING, Published():
            return _request() if state.late is None else _forward(state.late)
    raise ValueError(f"{event} while {state.phase.name}")


def _request() -> tuple[State, Action]:
    return State(Phase.POLLING), Request()


def _forward(message: Any) -> tuple[State, Action]:
    return State(Phase.TO_HMT), WriteHmt(message)
