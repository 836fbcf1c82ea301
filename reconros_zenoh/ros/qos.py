"""Quality of service: the ROS 2 profile and its compact form in a graph token."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Self, TypeVar

from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

INFINITE_NS = 2**63 - 1
"""The infinite duration of rmw: 9223372036 s and 854775807 ns."""

_SECOND_NS = 1_000_000_000
_INFINITE_S, _INFINITE_REST_NS = divmod(INFINITE_NS, _SECOND_NS)
_LARGEST_DEPTH = 2**64 - 1
_DEEPEST_QUEUE = 2**31 - 1


class Reliability(IntEnum):
    """Whether a sample may be lost; the values are those of `rmw_qos_reliability_policy_e`."""

    RELIABLE = 1
    BEST_EFFORT = 2


class Durability(IntEnum):
    """Whether a late subscriber gets old samples; the values are those of `rmw_qos_durability_policy_e`."""

    TRANSIENT_LOCAL = 1
    VOLATILE = 2


class History(IntEnum):
    """How many samples wait for the reader; the values are those of `rmw_qos_history_policy_e`."""

    KEEP_LAST = 1
    KEEP_ALL = 2


class Liveliness(IntEnum):
    """Who says that a publisher is alive; the values are those of `rmw_qos_liveliness_policy_e`."""

    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3


@dataclass(frozen=True, slots=True)
class QosProfile:
    """A QoS profile; without arguments it is the default of rclcpp and rclpy (depth 10).

    `depth` counts samples and has no meaning with KEEP_ALL. Durations are nanoseconds up to INFINITE_NS.
    """

    reliability: Reliability = Reliability.RELIABLE
    durability: Durability = Durability.VOLATILE
    history: History = History.KEEP_LAST
    depth: int = 10
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness: Liveliness = Liveliness.AUTOMATIC
    lease_ns: int = INFINITE_NS

    def __post_init__(self) -> None:
        for name, policies in _ENUMS.items():
            policy = getattr(self, name)
            if not isinstance(policy, policies):
                known = " or ".join(f"{policies.__name__}.{known.name}" for known in policies)
                raise UsageError(f"{name} is {policy!r}. Write {known}.")
        for name, largest in _NUMBERS.items():
            number = getattr(self, name)
            if not isinstance(number, int) or not 0 <= number <= largest:
                raise UsageError(f"{name} is {number!r}. Write a whole number from 0 to {largest}.")

    @classmethod
    def or_default(cls, qos: QosProfile | None) -> QosProfile:
        """Return the profile, or the default in place of None; raise UsageError for anything else."""
        if qos is None:
            return cls()
        if not isinstance(qos, cls):
            raise UsageError(f"qos is {qos!r}. Write a QosProfile: QosProfile(depth=10).")
        return qos

    @classmethod
    def of_words(cls, words: Mapping[str, str | int]) -> Self:
        """Return the profile with these policies, named as in the QoS files and options of ROS 2.

        `words` may have "reliability": "reliable" or "best_effort", "durability": "volatile" or
        "transient_local", "history": "keep_last" or "keep_all", and "depth"; what is missing has its default.
        Raises UsageError for anything else.
        """
        policies: dict[str, Any] = {}
        for name, word in words.items():
            if name == "depth":
                if not isinstance(word, int) or not 0 < word <= _DEEPEST_QUEUE:
                    raise UsageError(f"depth is {word!r}. Write a number from 1 to {_DEEPEST_QUEUE}.")
                policies[name] = word
            elif name in _POLICIES:
                known = {policy.name.lower(): policy for policy in _POLICIES[name]}
                if word not in known:
                    raise UsageError(f"{name} is {word!r}. Write {' or '.join(known)}.")
                policies[name] = known[str(word)]
            else:
                raise UsageError(f"there is no QoS policy {name!r}. Known: {', '.join(_POLICIES)}, depth.")
        return cls(**policies)

    def words(self) -> dict[str, str | int]:
        """Return the policies that `of_words` takes, all of them."""
        policies = {name: getattr(self, name).name.lower() for name in _POLICIES}
        return {**policies, "depth": self.depth}

    @property
    def queue_depth(self) -> int | None:
        """How many samples a queue holds at most; None with KEEP_ALL. Raises UsageError if that is none."""
        if self.history is History.KEEP_LAST and self.depth < 1:
            raise UsageError(
                f"a queue that keeps the last {self.depth} messages keeps none. Raise the depth."
            )
        return self.depth if self.history is History.KEEP_LAST else None

    def encode(self) -> str:
        """Return the QoS part of an endpoint token, for example `::,10:,:,:,,`.

        A field that equals the default of rmw_zenoh (whose depth is 42) is empty, as in
        `qos_to_keyexpr` of rmw_zenoh_cpp.
        """
        default = _RMW_DEFAULT
        return ":".join(
            (
                _field(self.reliability, default.reliability),
                _field(self.durability, default.durability),
                f"{_field(self.history, default.history)},{_field(self.depth, default.depth)}",
                _duration(self.deadline_ns),
                _duration(self.lifespan_ns),
                f"{_field(self.liveliness, default.liveliness)},{_duration(self.lease_ns)}",
            )
        )

    @classmethod
    def decode(cls, text: str) -> Self:
        """Return the profile that `text`, the QoS part of an endpoint token, stands for.

        What the endpoint leaves to the system, or to whom it meets (rmw_zenoh does not settle that), is the
        default. Raises ValueError when a part is missing, is no number, or names no policy.
        """
        parts = text.split(":")
        if [part.count(",") for part in parts] != [0, 0, 1, 1, 1, 2]:
            raise ValueError(f"QoS {text!r} is not of the form rel:dur:hist,depth:s,ns:s,ns:liv,s,ns")
        default = _RMW_DEFAULT
        history, depth = parts[2].split(",")
        liveliness, lease = parts[5].split(",", 1)
        return cls(
            _policy(parts[0], default.reliability, text),
            _policy(parts[1], default.durability, text),
            _policy(history, default.history, text),
            _number(depth, default.depth, _LARGEST_DEPTH, text),
            _nanoseconds(parts[3], text),
            _nanoseconds(parts[4], text),
            _policy(liveliness, default.liveliness, text),
            _nanoseconds(lease, text),
        )


_POLICIES: Mapping[str, type[IntEnum]] = {
    "reliability": Reliability,
    "durability": Durability,
    "history": History,
}
_ENUMS: Mapping[str, type[IntEnum]] = {**_POLICIES, "liveliness": Liveliness}
_NUMBERS = {
    "depth": _LARGEST_DEPTH,
    "deadline_ns": INFINITE_NS,
    "lifespan_ns": INFINITE_NS,
    "lease_ns": INFINITE_NS,
}
_RMW_DEFAULT = QosProfile(depth=42)
# SYSTEM_DEFAULT and BEST_AVAILABLE of each policy
_LEFT_OPEN: Mapping[type[IntEnum], tuple[str, ...]] = {
    Reliability: ("0", "4"),
    Durability: ("0", "4"),
    History: ("0",),
    Liveliness: ("0", "5"),
}

_Policy = TypeVar("_Policy", Reliability, Durability, History, Liveliness)


def _field(value: int, default: int) -> str:
    return "" if value == default else str(int(value))


def _duration(nanoseconds: int) -> str:
    seconds, rest_ns = divmod(nanoseconds, _SECOND_NS)
    return f"{_field(seconds, _INFINITE_S)},{_field(rest_ns, _INFINITE_REST_NS)}"


def _number(field: str, default: int, largest: int, text: str) -> int:
    if not field:
        return default
    # The length is bounded first: Python refuses to convert thousands of digits.
    if not (field.isascii() and field.isdecimal() and len(field) <= 20 and int(field) <= largest):
        raise ValueError(f"QoS {text!r}: {field!r} is not a number from 0 to {largest}")
    return int(field)


def _policy(field: str, default: _Policy, text: str) -> _Policy:
    kind = type(default)
    for policy in kind:
        if field == str(policy.value):
            return policy
    if not field or field in _LEFT_OPEN[kind]:
        return default
    known = ", ".join(f"{policy.value} ({policy.name})" for policy in kind)
    raise ValueError(f"QoS {text!r}: {field!r} is no {kind.__name__.lower()}, which is one of {known}")


def _nanoseconds(field: str, text: str) -> int:
    seconds, rest_ns = field.split(",")
    total_ns = _number(seconds, _INFINITE_S, _INFINITE_S, text) * _SECOND_NS
    return min(total_ns + _number(rest_ns, _INFINITE_REST_NS, _SECOND_NS - 1, text), INFINITE_NS)
