"""What serialisation takes without a word, and no node could read, or read as something else."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype

from reconros_zenoh.ros.forms import is_number, number

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rosbags.interfaces.typing import FieldDesc
    from rosbags.typesys.store import Typestore


class FieldChecks:
    """The checks of the messages of one type, those in messages of its fields included.

    Serialisation takes the bytes of an array as they are, so one of another dtype would arrive as other
    numbers. It knows no bounds, and takes the letters of a string for the strings of an array.
    """

    def __init__(self, store: Typestore, type_name: str) -> None:
        self._type_name = type_name
        self._arrays: list[tuple[str, tuple[np.dtype[Any], ...]]] = []
        self._lengths: list[tuple[str, int, int]] = []
        self._strings: list[tuple[str, int]] = []
        self._messages: list[tuple[str, FieldChecks]] = []
        self._lists: list[tuple[str, FieldChecks]] = []
        for field, form in store.get_msgdef(type_name).fields:
            if form[0] == Nodetype.NAME:
                self._add_nested(self._messages, field, FieldChecks(store, form[1]))
            elif form[0] == Nodetype.ARRAY or form[0] == Nodetype.SEQUENCE:
                element, length = form[1]
                if length:
                    self._lengths.append((field, length if form[0] == Nodetype.ARRAY else 0, length))
                if element[0] == Nodetype.NAME:
                    self._add_nested(self._lists, field, FieldChecks(store, element[1]))
                elif is_number(element):
                    dtype = np.dtype(number(element).str)  # the very object that most arrays have
                    # A byte is a signed one as rosbags has it, and an unsigned one in C.
                    dtypes = (dtype, np.dtype("i1")) if element[1][0] == "byte" else (dtype,)
                    self._arrays.append((field, dtypes))
                else:
                    self._strings.append((field, _bound(element)))
            elif not is_number(form) and form[1][1]:
                self._lengths.append((field, 0, _bound(form)))
        self.are_some = bool(self._arrays or self._lengths or self._strings or self._messages or self._lists)

    def check(self, message: object) -> None:
        """Raise TypeError for a field of another dtype or length, AttributeError for a missing one."""
        for field, dtypes in self._arrays:
            array = getattr(message, field)
            is_array = isinstance(array, np.ndarray)
            if not is_array or array.dtype not in dtypes:
                found = f"an array of {array.dtype}" if is_array else f"a {type(array).__name__}"
                raise self._error(field, f"is {found}, not an array of {dtypes[0]}")
        for field, least, most in self._lengths:
            length = len(getattr(message, field))
            if not least <= length <= most:
                raise self._error(field, f"is of length {length}, not {most if least else f'at most {most}'}")
        for field, most in self._strings:
            self._check_strings(field, getattr(message, field), most)
        for field, nested in self._messages:
            nested.check(getattr(message, field))
        for field, nested in self._lists:
            for element in getattr(message, field):
                nested.check(element)

    def _check_strings(self, field: str, strings: Iterable[str], most: int) -> None:
        if isinstance(strings, str):
            raise self._error(field, "is a str, not a list of them")
        longest = max(map(len, strings), default=0)
        if longest > most:
            raise self._error(field, f"has a string of length {longest}, not at most {most}")

    def _error(self, field: str, problem: str) -> TypeError:
        return TypeError(f"field {field!r} of {self._type_name} {problem}")

    @staticmethod
    def _add_nested(fields: list[tuple[str, FieldChecks]], field: str, nested: FieldChecks) -> None:
        if nested.are_some:
            fields.append((field, nested))


def _bound(string: FieldDesc) -> int:
    """Return how long a string can be."""
    bound = string[1][1]
    return bound if isinstance(bound, int) and bound else sys.maxsize
