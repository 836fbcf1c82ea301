"""What a project is given to do in virtual time: messages at a rate, or those of a recording."""

from __future__ import annotations

import heapq
from contextlib import closing
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from rosbags.rosbag2 import Reader, ReaderError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from reconros_zenoh.errors import UsageError
from reconros_zenoh.ros.zero_message import message_of

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping, Sequence
    from pathlib import Path

    import simpy

    from reconros_zenoh.rmw.publisher import Publisher
    from reconros_zenoh.ros.type_registry import TypeRegistry
    from reconros_zenoh.transport.base import Parts

    Schedule: TypeAlias = Generator[tuple[int, str, Parts], None, None]

_S = 1_000_000_000


class Stimulus(NamedTuple):
    """Messages for topics, each at its time.

    `types` names the type of each topic, `periodic` the encoded message of each that is sent at a rate, every
    `period_ns`, and `bag` a recording of which the other topics are played.
    """

    types: Mapping[str, str]
    periodic: Mapping[str, Parts]
    period_ns: int
    bag: Path | None

    def schedule(self) -> Schedule:
        """Yield the time [ns], topic and encoded message of each in the order of time, perhaps for ever.

        To be closed, if it is not gone through to its end.
        """
        played = [] if self.bag is None else [self._recorded(self.bag)]
        count = len(self.periodic)
        # Not all at once: publishers that know nothing of each other would not be, either.
        periodic = (
            self._repeated(topic, self.period_ns * number // count)
            for number, topic in enumerate(self.periodic, start=1)
        )
        yield from heapq.merge(*periodic, *played, key=lambda message: message[0])

    def _repeated(self, topic: str, at_ns: int) -> Schedule:
        while True:
            yield at_ns, topic, self.periodic[topic]
            at_ns += self.period_ns

    def _recorded(self, path: Path) -> Schedule:
        with Reader(path) as bag:
            connections = [
                each for each in bag.connections if each.topic in self.types.keys() - self.periodic.keys()
            ]
            if not connections:  # of none it would yield all
                return
            # Closed before the bag, which cannot be while somebody reads: a run may end before its recording.
            with closing(bag.messages(connections)) as messages:
                for connection, at_ns, payload in messages:
                    yield at_ns - bag.start_time, connection.topic, (payload,)


def read_inputs(inputs: Sequence[str], known: Mapping[str, str], types: TypeRegistry) -> dict[str, Parts]:
    """Return the encoded message by topic of inputs `TOPIC` or `TOPIC=FIELDS`.

    `known` has the types of the topics, FIELDS are YAML as of `ros2 topic pub`; what they leave out is zero.
    Raise UsageError for anything else.
    """
    messages: dict[str, Parts] = {}
    for given in inputs:
        topic, _, text = given.partition("=")
        if topic not in known:
            raise UsageError(
                f"the project does not wait for {topic!r} from outside. It does for: {_listed(known)}; what "
                "it publishes itself is not from outside."
            )
        if topic in messages:
            raise UsageError(f"{topic} has two inputs. Give all its fields in one --input.")
        message_type = types.message(known[topic])
        messages[topic] = message_type.encode(message_of(message_type, _fields(given, text)))
    return messages


def bag_topics(path: Path, known: Mapping[str, str], types: TypeRegistry) -> tuple[dict[str, str], float]:
    """Return the topics of a rosbag2 recording that are known, with their types, and its length [s].

    Topics without a message are left out. Raise UsageError when it cannot be read, has none of them, or one
    with another type.
    """
    try:
        with Reader(path) as bag:
            connections, seconds = list(bag.connections), bag.duration / _S
    except (ReaderError, OSError, ValueError, KeyError, TypeError) as error:
        told = str(error).removesuffix(".")
        raise UsageError(f"{path} cannot be read as a rosbag2 recording: {told}. Give its folder.") from error
    for connection in connections:
        if connection.topic in known:
            expected = types.message(known[connection.topic])
            if connection.msgtype != expected.name:
                raise UsageError(
                    f"{path}: {connection.topic} was recorded as {connection.msgtype}, not {expected.name}."
                )
            if connection.digest.startswith("RIHS01") and connection.digest != expected.type_hash:
                raise UsageError(
                    f"{path}: {connection.topic} was recorded with another definition of {expected.name}."
                )
    recorded = {each.topic: each.msgtype for each in connections if each.msgcount}
    found = {topic: name for topic, name in recorded.items() if topic in known}
    if not found:
        raise UsageError(
            f"{path} has no message that the project waits for. It has: {_listed(recorded)}; the project "
            f"waits for: {_listed(known)}."
        )
    return found, seconds


def feed(
    environment: simpy.Environment, publishers: Mapping[str, Publisher], schedule: Schedule
) -> Generator[simpy.Event, Any, None]:
    """Publish the messages of a schedule; a process of the environment."""
    for at_ns, topic, parts in schedule:
        if at_ns > environment.now:
            yield environment.timeout(at_ns - environment.now)
        publishers[topic].publish_encoded(parts)


def _fields(given: str, text: str) -> Mapping[str, Any]:
    try:
        fields = YAML(typ="safe").load(text) if text.strip() else {}
    except (YAMLError, ValueError, RecursionError) as error:
        raise UsageError(f"{given!r} is no YAML after the `=`: {str(error).splitlines()[0]}.") from error
    if not isinstance(fields, dict):
        raise UsageError(
            f"{given!r}: write the fields as of `ros2 topic pub`, for example '/angle={{data: 80}}'."
        )
    return fields


def _listed(topics: Mapping[str, str]) -> str:
    return ", ".join(f"{topic} ({name})" for topic, name in topics.items()) or "none"
