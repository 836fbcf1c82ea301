"""Where the time of a message goes."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.board.stages import Stage
    from reconros_zenoh.board.trace import Track
    from reconros_zenoh.clock.virtual import VirtualEnvironment


class Timeline:
    """The stages of one message, without gap, until what its callback made of it has been passed on.

    Where that goes to a reader on the same board, the reader's timeline follows; `began_ns` is when the first
    of them started. `callback` is the callback or gateway that serves the message, empty until it took it;
    `waits_for` is what that waits for now until others provide it; `track` is where a trace shows it. A
    message that came from a clock that is ahead, or that was set back since, starts now.
    """

    __slots__ = (
        "_environment",
        "_since_ns",
        "began_ns",
        "callback",
        "stages_ns",
        "started_ns",
        "track",
        "waits_for",
    )

    def __init__(self, environment: VirtualEnvironment, started_ns: int) -> None:
        self._environment = environment
        self.started_ns = self.began_ns = self._since_ns = min(started_ns, environment.now)
        self.callback = self.waits_for = ""
        self.track: Track | None = None
        self.stages_ns: defaultdict[Stage, int] = defaultdict(int)

    def mark(self, stage: Stage) -> None:
        """Account the time since the last mark to `stage`."""
        now = self._environment.now
        if self.track is not None:
            self.track.stage(stage, self._since_ns)
        self.stages_ns[stage] += now - self._since_ns
        self._since_ns = now

    def fork(self) -> Timeline:
        """Return a timeline with the same past: of a message that the callback published."""
        other = Timeline(self._environment, self.started_ns)
        other.began_ns = self.began_ns
        other._since_ns = self._since_ns
        other.callback = self.callback
        other.stages_ns = self.stages_ns.copy()
        return other

    def follow(self) -> Timeline:
        """Return the timeline of a reader on this board; it begins now, or when `begin` is called."""
        other = Timeline(self._environment, self._environment.now)
        other.began_ns = self.began_ns
        return other

    def begin(self) -> None:
        """Start now, at the end of the timeline that this one follows."""
        self.started_ns = self._since_ns = self._environment.now

    @property
    def age_ns(self) -> int:
        """The time to the last mark since what caused all of it: a message from elsewhere, or a timer."""
        return self._since_ns - self.began_ns


class _Sums:
    """The stages of timelines, added up."""

    __slots__ = ("count", "stages_ns")

    def __init__(self) -> None:
        self.count = 0
        self.stages_ns: defaultdict[Stage, int] = defaultdict(int)

    def add(self, timeline: Timeline) -> None:
        self.count += 1
        stages_ns = self.stages_ns
        for stage, duration_ns in timeline.stages_ns.items():
            stages_ns[stage] += duration_ns


class Spans:
    """The stages of all messages that callbacks passed on, added up by callback.

    A message is passed on when it has left the board, or, where nobody elsewhere reads it, when it has been
    published on the board. Of a callback that passes nothing on the calls are counted instead.
    """

    def __init__(self) -> None:
        self._messages: defaultdict[str, _Sums] = defaultdict(_Sums)
        self._calls: defaultdict[str, _Sums] = defaultdict(_Sums)

    def add(self, timeline: Timeline) -> None:
        """Count a message that has been passed on."""
        self._messages[timeline.callback].add(timeline)

    def end(self, timeline: Timeline) -> None:
        """Note that a call has ended; it is of no matter once its callback has passed a message on."""
        if timeline.callback not in self._messages:
            self._calls[timeline.callback].add(timeline)

    def mean_ms(self) -> Mapping[str, Mapping[Stage, float]]:
        """Return for each callback the mean time of each stage per message or call [ms]."""
        calls = {name: sums for name, sums in self._calls.items() if name not in self._messages}
        return {
            callback: {stage: total / sums.count / 1e6 for stage, total in sums.stages_ns.items()}
            for callback, sums in (self._messages | calls).items()
        }
