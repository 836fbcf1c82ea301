"""What is known of a kind of board: a TOML file of quantities, each with unit and basis."""

from __future__ import annotations

import difflib
from importlib import resources
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from reconros_zenoh.board.bitstream_fit import BitstreamFit, frames
from reconros_zenoh.board.quantity import (
    Bandwidth,
    CostPerByte,
    Count,
    Duration,
    Fraction,
    Frequency,
    PositiveSize,
    RetryProbability,
    Share,
    Size,
)
from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.toml_file import UNKNOWN_KEY, TomlFile, first_mistake

_FOLDER = Path(str(resources.files("reconros_zenoh.board"))) / "profiles"

_NATIVE_BITSTREAM_SIZE = 4096
"""Where nothing is modelled a bitstream only has to exist."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class CoresSection(_Section):
    """The processor cores."""

    count: Count
    clock: Frequency


class FabricSection(_Section):
    """The reconfigurable part.

    `thread_clock` is the clock of hardware threads at which the `compute` times of callbacks hold, and that
    of slots which declare none.
    """

    thread_clock: Frequency


class ExecutorSection(_Section):
    """What the reference implementation of the executor costs.

    An idle worker looks for work once per poll period, whose length varies by `poll_jitter` (relative
    standard deviation). `dispatch` is processor time per callback: taking the message and starting the
    function or the slot.
    """

    hardware_poll: Duration
    software_poll: Duration
    poll_jitter: Fraction
    dispatch: Duration


class DdsSection(_Section):
    """The ROS 2 communication stack, per message and direction.

    A message takes `per_message` and its bytes; one of more than `large_from` goes in fragments of that size
    and takes `receive_per_byte_large` or `send_per_byte_large`. Meanwhile the stack keeps one core busy for
    `core_share` of the time. Times vary by `jitter` (standard deviation of their logarithm). A large message
    that comes in is resent whole with probability `nack_probability`, `nack_delay` after its first copy. With
    `loss_probability`, or `loss_probability_busy` if it comes while all cores are busy or the stack is
    stalled, it waits for the next heartbeat of its writer, one per `heartbeat_period`. `recovery` is how long
    the stack needs to go on after a reconfiguration stalled it.
    """

    per_message: Duration
    per_byte: CostPerByte
    receive_per_byte_large: CostPerByte
    send_per_byte_large: CostPerByte
    large_from: Size
    core_share: Share
    jitter: Fraction
    nack_probability: RetryProbability
    nack_delay: Duration
    loss_probability: Fraction
    loss_probability_busy: Fraction
    heartbeat_period: Duration
    recovery: Duration
    stalled_by_reconfiguration: bool


class LinkSection(_Section):
    """The network between board and desktop, one way, with the desktop's own share."""

    latency: Duration
    per_byte: CostPerByte


class IcapSection(_Section):
    """The configuration port: `t_rc = S / bandwidth + offset`."""

    bandwidth: Bandwidth
    offset: Duration


class MemifSection(_Section):
    """The memory interface that all slots share."""

    bandwidth: Bandwidth


class TopicsSection(_Section):
    """Software-mapped topics between nodes of one board.

    A publication takes `publish`, and for a software publisher `copy_in` per byte. It then wakes the hardware
    readers one after another: `notify_hardware` each until they start, of which `notify_software` holds a
    software publisher and with it the software readers up. A software reader copies what a software publisher
    wrote at `copy_out` per hardware reader, because they read at the same time, and what a hardware publisher
    wrote at the speed of the MEMIF.
    """

    publish: Duration
    notify_hardware: Duration
    notify_software: Duration
    copy_in: CostPerByte
    copy_out: CostPerByte


class GatewaySection(_Section):
    """A gateway core: what it takes to `cancel` its request to the delegate, before it can publish."""

    cancel: Duration


class HmtSection(_Section):
    """The streams of hardware-mapped topics: `overhead` is what a subscriber needs to take a message over."""

    overhead: Duration
    bandwidth: Bandwidth


class OsifSection(_Section):
    """The operating system interface: one call through the delegate thread."""

    call: Duration


class BitstreamSection(_Section):
    """The size of a partial bitstream of a slot with these resources."""

    lut: Annotated[int, Field(gt=0)]
    dsp: Annotated[int, Field(ge=0)]
    bram36: Annotated[int, Field(ge=0)]
    size: PositiveSize

    @property
    def frames(self) -> float:
        """The configuration frames of these resources."""
        return frames(self.lut, self.dsp, self.bram36)


class CallbackSection(_Section):
    """How long a callback takes in isolation.

    `software` is processor time. `compute` is what a slot at `thread_clock` computes; with the memory
    transfers and the calls of the hardware thread it adds up to the execution time in hardware.
    """

    software: Duration
    compute: Duration


class Model(_Section):
    """All modelled times of a board."""

    cores: CoresSection
    fabric: FabricSection
    executor: ExecutorSection
    dds: DdsSection
    link: LinkSection
    icap: IcapSection
    memif: MemifSection
    osif: OsifSection
    bitstreams: Annotated[tuple[BitstreamSection, ...], Field(min_length=1, strict=False)]
    callbacks: dict[str, CallbackSection] = {}
    topics: TopicsSection | None = None
    gateway: GatewaySection | None = None
    hmt: HmtSection | None = None


class Profile(_Section):
    """A kind of board; without `model` nothing is modelled and everything takes as long as it takes."""

    name: str
    description: str
    model: Model | None = None

    def bitstream_size(self, lut: int, dsp: int, bram36: int) -> int:
        """Return the size [bytes] of a partial bitstream of a slot with these resources.

        The size of a slot that the profile does not list is estimated from those it lists.
        """
        if self.model is None:
            return _NATIVE_BITSTREAM_SIZE
        known = self.model.bitstreams
        for slot in known:
            if (slot.lut, slot.dsp, slot.bram36) == (lut, dsp, bram36):
                return slot.size.bytes
        fit = BitstreamFit.of([(slot.frames, slot.size.bytes) for slot in known])
        return fit.size(frames(lut, dsp, bram36))


def profile_names() -> list[str]:
    """Return the names of the profiles that ship."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def profile_path(name_or_file: str | Path) -> Path:
    """Return the file of the shipped profile of that name, or that file; UsageError for an unknown name."""
    names, given = profile_names(), str(name_or_file)
    if given in names:
        return _FOLDER / f"{given}.toml"
    path = Path(given)
    if path.suffix != ".toml":
        raise UsageError(f"no profile named {given!r}. Give one of {', '.join(names)} or a .toml file.")
    return path


def read_profile(name_or_file: str | Path) -> Profile:
    """Return the shipped profile of that name, or the one in that file.

    Raise FileError with the line for a file that is not a profile, UsageError for an unknown name.
    """
    path = profile_path(name_or_file)
    toml = TomlFile.read(path)
    try:
        return Profile.model_validate(toml.content)
    except ValidationError as error:
        first = first_mistake(error)
        place = [str(key) for key in first["loc"]]
        key = ".".join(place)
        problem, remedy = f"{first['msg']}.", f"Correct {key}; the shipped profiles show every key."
        if first["type"] == UNKNOWN_KEY:
            problem = "there is no such key."
            missing = [
                str(mistake["loc"][-1])
                for mistake in error.errors()
                if mistake["type"] == "missing" and mistake["loc"][:-1] == first["loc"][:-1]
            ]
            if meant := difflib.get_close_matches(place[-1], missing, n=1):
                remedy = f"Did you mean {meant[0]}?"
        raise FileError(path, toml.line(place), f"{key}: {problem}", remedy) from None
