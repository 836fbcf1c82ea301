"""Where the time of a message goes."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.clock.virtual import VirtualEnvironment

Stage = Literal[
    "transport",  # on the network, with the desktop's share
    "dds",  # in the communication stack, waiting for cores included
    "retransmission",  # lost and sent again
    "queue",  # ready, until a worker took it
    "dispatch",  # from being taken to being started
    "reconfiguration",  # until the slot held its bitstream, waiting for the ICAP included
    "execution",  # computing
    "memif",  # memory transfers of a slot
    "blocked",  # waiting for a mailbox, mutex, condition or semaphore
    "hmt",  # on the stream of a hardware-mapped topic, waiting for room included
    "gateway",  # in a gateway core: waiting for it, and until its request is cancelled
    "osif",  # calls of a slot through its delegate thread
    "overrun",  # the host was slower than the modelled time
]


class Timeline:
    """The stages of one message, without gap: their times sum to its end-to-end time.

    `callback` is the callback that serves the message, empty until a worker took it. A message that came
    from a clock that is ahead, or that was set back since, starts now.
    """

    __slots__ = ("_environment", "_since_ns", "callback", "stages_ns", "started_ns")

    def __init__(self, environment: VirtualEnvironment, started_ns: int) -> None:
        self._environment = environment
        self.started_ns = min(started_ns, environment.now)
        self._since_ns = self.started_ns
        self.callback = ""
        self.stages_ns: defaultdict[Stage, int] = defaultdict(int)

    def mark(self, stage: Stage) -> None:
        """Account the time since the last mark to `stage`."""
        now = self._environment.now
        self.stages_ns[stage] += now - self._since_ns
        self._since_ns = now

    def fork(self) -> Timeline:
        """Return a timeline with the same past: of a message that the callback published."""
        other = Timeline(self._environment, self.started_ns)
        other._since_ns = self._since_ns
        other.callback = self.callback
        other.stages_ns = self.stages_ns.copy()
        return other

    @property
    def total_ns(self) -> int:
        """The time from the start to the last mark."""
        return self._since_ns - self.started_ns


class Spans:
    """The stages of all messages that left the board, added up by callback."""

    def __init__(self) -> None:
        self._messages: defaultdict[str, int] = defaultdict(int)
        self._stages_ns: defaultdict[str, defaultdict[Stage, int]] = defaultdict(lambda: defaultdict(int))

    def add(self, timeline: Timeline) -> None:
        """Count a message whose timeline is complete."""
        self._messages[timeline.callback] += 1
        stages_ns = self._stages_ns[timeline.callback]
        for stage, duration_ns in timeline.stages_ns.items():
            stages_ns[stage] += duration_ns

    def mean_ms(self) -> Mapping[str, Mapping[Stage, float]]:
        """Return for each callback the mean time of each stage per message [ms]."""
        return {
            callback: {stage: total / self._messages[callback] / 1e6 for stage, total in stages.items()}
            for callback, stages in self._stages_ns.items()
        }
