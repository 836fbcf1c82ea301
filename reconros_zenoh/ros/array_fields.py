"""The fields of messages that are arrays of numbers, and what may stand in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype

from reconros_zenoh.ros.c_layout import is_number, number

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


class ArrayFields:
    """The arrays of numbers in the messages of one type, those in messages of its fields included.

    Serialisation takes their bytes as they are, so an array of another dtype would arrive as other numbers.
    """

    def __init__(self, store: Typestore, type_name: str) -> None:
        self._type_name = type_name
        self._arrays: list[tuple[str, tuple[np.dtype[Any], ...]]] = []
        self._messages: list[tuple[str, ArrayFields]] = []
        self._lists: list[tuple[str, ArrayFields]] = []
        for field, form in store.get_msgdef(type_name).fields:
            if form[0] == Nodetype.NAME:
                self._add_nested(self._messages, field, ArrayFields(store, form[1]))
            elif form[0] == Nodetype.ARRAY or form[0] == Nodetype.SEQUENCE:
                element = form[1][0]
                if element[0] == Nodetype.NAME:
                    self._add_nested(self._lists, field, ArrayFields(store, element[1]))
                elif is_number(element):
                    dtype = np.dtype(number(element).str)  # the very object that most arrays have
                    # A byte is a signed one as rosbags has it, and an unsigned one in C.
                    dtypes = (dtype, np.dtype("i1")) if element[1][0] == "byte" else (dtype,)
                    self._arrays.append((field, dtypes))
        self.are_some = bool(self._arrays or self._messages or self._lists)

    def check(self, message: object) -> None:
        """Raise TypeError for a field that is no array of its dtype, AttributeError for a missing one."""
        for field, dtypes in self._arrays:
            array = getattr(message, field)
            if getattr(array, "dtype", None) not in dtypes:
                is_array = isinstance(array, np.ndarray)
                found = f"an array of {array.dtype}" if is_array else f"a {type(array).__name__}"
                raise TypeError(
                    f"field {field!r} of {self._type_name} is {found}, not an array of {dtypes[0]}"
                )
        for field, nested in self._messages:
            nested.check(getattr(message, field))
        for field, nested in self._lists:
            for element in getattr(message, field):
                nested.check(element)

    @staticmethod
    def _add_nested(fields: list[tuple[str, ArrayFields]], field: str, nested: ArrayFields) -> None:
        if nested.are_some:
            fields.append((field, nested))
