"""One board: its parts, wired."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import TYPE_CHECKING

from reconros_zenoh.board.address_space import AddressSpace
from reconros_zenoh.board.cpu import Cpu
from reconros_zenoh.board.dds import DdsStack
from reconros_zenoh.board.gateway import Gateway
from reconros_zenoh.board.hmt import HardwareTopic, hmt_key
from reconros_zenoh.board.host import Host, ThreadedHost
from reconros_zenoh.board.local_topics import LocalTopics, LocalTopicWriter
from reconros_zenoh.board.log import BoardLog
from reconros_zenoh.board.memif import Memif
from reconros_zenoh.board.osif import Osif
from reconros_zenoh.board.slots import Slot
from reconros_zenoh.board.spans import Spans
from reconros_zenoh.board.trace import Trace
from reconros_zenoh.board.writers import TopicWriter
from reconros_zenoh.board.zycap import ZyCAP
from reconros_zenoh.errors import UsageError
from reconros_zenoh.gateway.filters import Pair, conflict
from reconros_zenoh.ros.qos import QosProfile

if TYPE_CHECKING:
    from collections.abc import Mapping

    from reconros_zenoh.board.executor import Executor
    from reconros_zenoh.board.profile import Profile
    from reconros_zenoh.clock.virtual import VirtualEnvironment
    from reconros_zenoh.rmw.node import Context, Node
    from reconros_zenoh.ros.types import MessageType
    from reconros_zenoh.transport.base import Publisher


_ANY_CLOCK_HZ = 1e9
"""Where nothing is modelled no cycle is counted."""


@dataclass(frozen=True, slots=True)
class SlotPlan:
    """A slot as the project declares it, with the resources of its regions.

    Without `clock_hz` it has the profile's clock for hardware threads. One that is not `reconfigurable`
    always holds the one hardware thread or gateway that is mapped to it.
    """

    slot_id: int
    lut: int
    dsp: int
    bram36: int
    clock_hz: int | None = None
    reconfigurable: bool = True


class Board:
    """Cores, slots, configuration port, memory interface and communication stack of one board.

    Without a model in its profile (`native`) every part is there and costs nothing. What does not say
    otherwise belongs to the event loop.
    """

    def __init__(
        self,
        environment: VirtualEnvironment,
        context: Context,
        profile: Profile,
        slots: tuple[SlotPlan, ...],
        *,
        name: str = "board0",
        seed: int = 0,
        threads: int | None = None,
        pointer_bytes: int = 4,
        tap: bool = False,
        traced: bool = False,
    ) -> None:
        """In wall time `threads` run the computations, and as many send; None: all in line, in virtual time.

        `tap` lets what passes its hardware-mapped topics out into the network, for debugging; `traced` keeps
        a `trace` of what its parts do.
        """
        model = profile.model
        self.environment = environment
        self.started_ns = environment.now
        self.context = context
        self.profile = profile
        self.name = name
        self.log = BoardLog(environment, self.started_ns, name)
        self.trace = Trace(environment) if traced else None
        self.cpu = Cpu(environment, int(model.cores.count.value) if model else 1)
        self.memif = Memif(environment, model.memif.bandwidth.bytes_per_ns if model else None)
        self.memory = AddressSpace(pointer_bytes)
        self.osif = Osif(self.cpu, model.osif.call.ns if model else 0)
        self.zycap = ZyCAP(environment, self.cpu, model.icap if model else None, model.dds if model else None)
        self.randomness = random.Random(f"{seed} {name}")
        self.dds = DdsStack(
            environment, self.cpu, model, self.randomness, self.trace.stack if self.trace else None
        )
        self.host = self._new_host(threads)
        # In threads of its own: a message does not wait until a worker's computation has ended.
        self.sending_host = self._new_host(threads)
        self.spans = Spans()
        self.topics = LocalTopics(self, model, model.topics) if model and model.topics else None
        self.writers: list[TopicWriter] = []
        self.hardware_topics: dict[str, HardwareTopic] = {}
        self.gateways: list[Gateway] = []
        self.executors: list[Executor] = []
        self._tap = tap
        self._taps: list[Publisher] = []
        self.slots: Mapping[int, Slot] = {
            plan.slot_id: Slot(
                environment,
                plan.slot_id,
                profile.bitstream_size(plan.lut, plan.dsp, plan.bram36),
                plan.clock_hz or (model.fabric.thread_clock.hz if model else _ANY_CLOCK_HZ),
                reconfigurable=plan.reconfigurable,
                trace=self.trace,
            )
            for plan in slots
        }

    def writer(
        self,
        node: Node,
        message_type: MessageType,
        topic: str,
        qos: QosProfile | None = None,
        *,
        in_place: bool = False,
    ) -> TopicWriter:
        """Return a new publisher on a software-mapped topic; `in_place` says that readers copy nothing."""
        if self.topics is None:
            writer = TopicWriter(self, node, message_type, topic, qos)
        else:
            writer = LocalTopicWriter(self, node, message_type, topic, self.topics, qos, in_place=in_place)
        self.writers.append(writer)
        return writer

    def hardware_topic(self, name: str, message_type: MessageType) -> HardwareTopic:
        """Return the hardware-mapped topic of that absolute name, the same one each time.

        Raise UsageError when it has another type.
        """
        topic = self.hardware_topics.get(name)
        if topic is None:
            topic = self.hardware_topics[name] = HardwareTopic(self, name, message_type)
            if self._tap:
                self._taps.append(topic.open_tap())
        if topic.type.name != message_type.name:
            raise UsageError(f"{topic.key} has the type {topic.type.name}, not {message_type.name}.")
        return topic

    def add_gateway(
        self,
        name: str,
        hmt: str,
        smt: str,
        message_type: MessageType,
        slot_id: int,
        qos: QosProfile | None = None,
        *,
        at_power_up: bool = True,
    ) -> Gateway:
        """Return a new gateway between the topics of these absolute names; `qos` is for its ends on the SMT.

        It has the slot for itself, which holds it since power-up, or else as soon as its bitstream is
        written. Raise UsageError when one of the topics has a gateway already or another type, for the name
        of another gateway, and for a slot that is not free.
        """
        if self.profile.model is not None and self.profile.model.gateway is None:
            raise UsageError(
                f"profile {self.profile.name!r} has no times for a gateway. Add a section [model.gateway] "
                "to a copy of the profile, or use the profile zcu104 or native."
            )
        slot = self.slots.get(slot_id)
        if slot is None:
            raise UsageError(f"there is no slot {slot_id}. The board has {sorted(self.slots) or 'none'}.")
        pair = Pair(hmt_key(self.name, hmt), smt)
        taken = conflict(pair, [gateway.pair for gateway in self.gateways])
        if taken is not None:
            raise UsageError(
                f"{taken} has a gateway on board {self.name!r} already: two would send messages round."
            )
        if any(gateway.name == name for gateway in self.gateways):
            raise UsageError(f"board {self.name!r} has a gateway {name!r} already. Give another name.")
        topic = self.hardware_topic(hmt, message_type)
        bitstream = slot.admit(name, alone=True)
        if at_power_up:
            slot.holds = bitstream
        gateway = Gateway(
            self, self.context.node(name), topic, smt, QosProfile.or_default(qos), slot, bitstream
        )
        self.gateways.append(gateway)
        return gateway

    def close(self) -> None:
        """Let running computations end; the board begins nothing any more."""
        for executor in self.executors:
            executor.close()
        for end in (*self.gateways, *self._taps):
            end.close()
        if self.topics is not None:
            self.topics.close()
        self.zycap.deinit()
        self.host.close()
        self.sending_host.close()

    def _new_host(self, threads: int | None) -> Host:
        if threads is None:
            return Host(self.environment)
        # Without a model no event has a time that it could miss.
        return ThreadedHost(self.environment, threads, modelled=self.profile.model is not None)
