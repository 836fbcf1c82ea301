"""The main memory as hardware threads see it: virtual addresses, and messages in it as C structs."""

from __future__ import annotations

from bisect import bisect_right, insort
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype

from reconros_zenoh.ros.c_layout import CLayout
from reconros_zenoh.ros.forms import is_number, number
from reconros_zenoh.ros.message_arrays import snapshot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from rosbags.interfaces.typing import FieldDesc

    from reconros_zenoh.ros.types import MessageType

_FIRST = 0x1000_0000
_END = 0xC000_0000  # where user memory ends on 32-bit Linux
_PAGE = 4096


class UnmappedError(Exception):
    """Nothing, or not all, lies in one block there."""


@dataclass(slots=True)
class _Block:
    """Some bytes; those that are not `owned` belong to a message as well: they are copied before a change."""

    content: NDArray[np.uint8]
    owned: bool


class AddressSpace:
    """Blocks of memory at virtual addresses, each with exact bounds and an unmapped page behind it.

    `pointer_bytes` is 4 or 8, as the processor has it. Belongs to the event loop. Source:
    Gateways, Section 2.2 ("the MEMIF interface enables memory accesses in virtual address space").
    """

    def __init__(self, pointer_bytes: int = 4) -> None:
        self.layout = CLayout(pointer_bytes)
        self._blocks: dict[int, _Block] = {}
        self._starts: list[int] = []
        self._next = _FIRST

    def map(self, content: NDArray[np.uint8], *, owned: bool = True) -> int:
        """Return the address at which these bytes (uint8, one dimension) can now be found."""
        address = self._free_address(len(content))
        self._blocks[address] = _Block(content, owned)
        insort(self._starts, address)
        self._next = address + _room(len(content))
        return address

    def unmap(self, address: int) -> None:
        """Take away the block at this address."""
        del self._blocks[address]
        self._starts.remove(address)

    def read(self, address: int, size: int) -> NDArray[np.uint8]:
        """Return a view of these bytes; raise UnmappedError unless they lie in one block."""
        block, offset = self._find(address, size)
        return block.content[offset : offset + size]

    def start(self, address: int) -> int:
        """Return where the block begins in which this address lies; raise UnmappedError where none is."""
        return address - self._find(address, 0)[1]

    def write(self, address: int, data: NDArray[np.uint8]) -> None:
        """Change the bytes from this address on; raise UnmappedError unless they lie in one block."""
        block, offset = self._find(address, len(data))
        if not block.owned:
            block.content = block.content.copy()
            block.owned = True
        block.content[offset : offset + len(data)] = data

    def place(self, message_type: MessageType, message: object) -> PlacedMessage:
        """Return the message once it stands in memory as a C struct."""
        placed = PlacedMessage(self, message_type)
        struct = np.zeros(self.layout.struct(message_type).size, np.uint8)
        placed.store(message_type, message, struct, 0)
        placed.address = placed.map(struct)
        return placed

    def load(self, message_type: MessageType, address: int) -> Any:
        """Return the message whose struct stands at this address; UnmappedError where a pointer is wrong.

        Its arrays are what they are now, whatever is written to the blocks later.
        """
        struct = self.layout.struct(message_type)
        return message_type.cls(
            **{
                name: self._value(message_type, form, address + offset)
                for name, (offset, form) in struct.fields.items()
            }
        )

    def _value(self, owner: MessageType, form: FieldDesc, address: int) -> Any:
        if form[0] == Nodetype.NAME:
            return self.load(owner.nested(form[1]), address)
        if form[0] == Nodetype.ARRAY:
            return self._elements(owner, form[1][0], address, form[1][1])
        if is_number(form):
            dtype = number(form)
            return self.read(address, dtype.itemsize).view(dtype)[0].item()
        words = self.read(address, 3 * self.layout.pointer.itemsize).view(self.layout.pointer)
        data, length = words[:2].tolist()
        if form[0] == Nodetype.SEQUENCE:
            return self._elements(owner, form[1][0], data, length)
        return self.read(data, length).tobytes().decode() if length else ""

    def _elements(self, owner: MessageType, form: FieldDesc, address: int, length: int) -> Any:
        size, _ = self.layout.size(owner, form)
        if not is_number(form):
            return [self._value(owner, form, address + place * size) for place in range(length)]
        dtype = number(form)
        if not length:
            return np.empty(0, dtype)
        return snapshot(self.read(address, length * size).view(dtype))

    def _find(self, address: int, size: int) -> tuple[_Block, int]:
        place = bisect_right(self._starts, address) - 1
        if place >= 0:
            start = self._starts[place]
            block = self._blocks[start]
            if 0 <= size <= len(block.content) - (address - start):
                return block, address - start
        raise UnmappedError

    def _free_address(self, size: int) -> int:
        """Return the lowest free address from where the last block ended, going round."""
        for start in (self._next, _FIRST):
            address = start
            while address + _room(size) <= _END:
                place = bisect_right(self._starts, address + _room(size) - 1) - 1
                if place < 0:
                    return address
                behind = self._starts[place] + _room(len(self._blocks[self._starts[place]].content))
                if behind <= address:
                    return address
                address = behind
        raise MemoryError("the address space of the board is full")


class PlacedMessage:
    """A message in memory: its struct at `address`, its strings and sequences in blocks of their own."""

    def __init__(self, space: AddressSpace, message_type: MessageType) -> None:
        self.message_type = message_type
        self.address = 0
        self._space = space
        self._mapped: list[int] = []

    def load(self) -> Any:
        """Return the message as it stands in memory now."""
        return self._space.load(self.message_type, self.address)

    def holds(self, address: int) -> bool:
        """Tell whether the block at this address is one of the message; UnmappedError where none is."""
        return self._space.start(address) in self._mapped

    def unmap(self) -> None:
        """Take it out of memory."""
        for address in self._mapped:
            self._space.unmap(address)

    def map(self, content: NDArray[np.uint8], *, owned: bool = True) -> int:
        """Map a block that goes when the message goes."""
        address = self._space.map(content, owned=owned)
        self._mapped.append(address)
        return address

    def store(self, message_type: MessageType, message: object, into: NDArray[np.uint8], start: int) -> None:
        """Write the struct of the message into these bytes from `start` on."""
        for name, (offset, form) in self._space.layout.struct(message_type).fields.items():
            self._store_value(message_type, form, getattr(message, name), into, start + offset)

    def _store_value(
        self, owner: MessageType, form: FieldDesc, value: Any, into: NDArray[np.uint8], start: int
    ) -> None:
        if form[0] == Nodetype.NAME:
            self.store(owner.nested(form[1]), value, into, start)
        elif form[0] == Nodetype.ARRAY:
            self._store_elements(owner, form[1][0], value, into, start)
        elif is_number(form):
            dtype = number(form)
            into[start : start + dtype.itemsize] = np.array([value], dtype).view(np.uint8)
        elif form[0] == Nodetype.SEQUENCE:
            self._store_words(self._sequence(owner, form[1][0], value), into, start)
        else:
            self._store_words(self._string(value), into, start)

    def _store_words(self, words: tuple[int, int, int], into: NDArray[np.uint8], start: int) -> None:
        content = np.array(words, self._space.layout.pointer).view(np.uint8)
        into[start : start + len(content)] = content

    def _string(self, text: str) -> tuple[int, int, int]:
        content = text.encode()
        address = self.map(np.frombuffer(content + b"\0", np.uint8), owned=False)
        return address, len(content), len(content) + 1

    def _sequence(self, owner: MessageType, form: FieldDesc, values: Sequence[Any]) -> tuple[int, int, int]:
        length = len(values)
        if not length:
            return 0, 0, 0
        if is_number(form):
            content = np.ascontiguousarray(values, number(form)).view(np.uint8)
            return self.map(content, owned=False), length, length
        content = np.zeros(length * self._space.layout.size(owner, form)[0], np.uint8)
        self._store_elements(owner, form, values, content, 0)
        return self.map(content), length, length

    def _store_elements(
        self, owner: MessageType, form: FieldDesc, values: Sequence[Any], into: NDArray[np.uint8], start: int
    ) -> None:
        if is_number(form):
            content = np.ascontiguousarray(values, number(form)).view(np.uint8)
            into[start : start + len(content)] = content
            return
        size, _ = self._space.layout.size(owner, form)
        for place, value in enumerate(values):
            self._store_value(owner, form, value, into, start + place * size)


def _room(size: int) -> int:
    """Return what a block takes up: whole pages and one that is not mapped."""
    return (size + 2 * _PAGE - 1) // _PAGE * _PAGE
