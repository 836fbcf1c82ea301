"""What a hardware callback is started with."""

from __future__ import annotations

from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from reconros_zenoh.ros.forms import is_number, number
from reconros_zenoh.ros.message_arrays import arrays_of, lies_in

if TYPE_CHECKING:
    from reconros_zenoh.board.address_space import AddressSpace, PlacedMessage
    from reconros_zenoh.ros.types import MessageType

Array: TypeAlias = "np.ndarray[Any, Any]"


class InitData:
    """The message that started a callback: its fields, and its address in main memory as a C struct.

    `init + 8` and `thread.mem_read(init, 4)` use the address. The struct is laid out on first use.
    """

    def __init__(self, message: Any, message_type: MessageType, memory: AddressSpace) -> None:
        self.message = message
        self._type = message_type
        self._memory = memory
        self._placed: PlacedMessage | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.message, name)

    def __add__(self, offset: int) -> int:
        return self.address + offset

    def __index__(self) -> int:
        return self.address

    @property
    def address(self) -> int:
        """The address of the struct; it is gone when the callback has ended."""
        if self._placed is None:
            self._placed = self._memory.place(self._type, self.message)
        return self._placed.address

    def array(self, path: str) -> Array:
        """Return a field, `data` or `header.stamp.sec`, as an array; a number as an array of one.

        Raises UsageError for what is no field of the message.
        """
        form = self._type.form(path)
        dtype = number(form) if is_number(form) else None
        array = np.atleast_1d(np.asarray(attrgetter(path)(self.message), dtype))
        self._arrays.append(array)
        return array

    def in_memory(self) -> Any:
        """Return the message as it stands in memory: with what the callback has written."""
        return self.message if self._placed is None else self._placed.load()

    def holds(self, source: Array | int) -> bool:
        """Tell whether all of an array, or of the block at an address, belongs to this message."""
        if not isinstance(source, np.ndarray):
            return self._placed is not None and self._placed.holds(source)
        for name, _ in reversed(self._type.fields):
            if getattr(self.message, name) is source:
                return True  # what callbacks read most, known without a look at where it lies
        return any(lies_in(source, array) for array in self._arrays)

    @cached_property
    def _arrays(self) -> list[Array]:
        """The arrays of the message, and those that were made of its other fields."""
        return list(arrays_of(self.message))

    def release(self) -> None:
        """Take the struct out of memory."""
        if self._placed is not None:
            self._placed.unmap()
            self._placed = None
