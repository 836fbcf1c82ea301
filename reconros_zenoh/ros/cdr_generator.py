"""Writes functions between messages and CDR as Python source: what encoding and decoding have in common."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

from reconros_zenoh.ros.forms import is_number, is_string, number

if TYPE_CHECKING:
    from collections.abc import Callable

    from rosbags.interfaces.typing import FieldDesc
    from rosbags.typesys.store import Typestore

V = TypeVar("V")

ENCAPSULATION = b"\0\1\0\0"
"""What precedes each message: positions count from its first byte, alignment from behind it."""

_CODES = {
    "b1": "?",
    "i1": "b",
    "u1": "B",
    "i2": "h",
    "u2": "H",
    "i4": "i",
    "u4": "I",
    "i8": "q",
    "u8": "Q",
    "f4": "f",
    "f8": "d",
}
_MAXALIGN = 8
ANYWHERE = frozenset(range(_MAXALIGN))


def fields_of(store: Typestore, type_name: str) -> list[tuple[str, FieldDesc]]:
    """Return the names of the fields of a message type, as its class has them, and their forms."""
    return [(normalize_fieldname(name), form) for name, form in store.fielddefs[type_name][1]]


class Number(NamedTuple):
    """A code of `struct`, what it is aligned to, and the expression or variable for its value.

    Without a code it only aligns what follows.
    """

    code: str
    alignment: int
    value: str | None


class Field(NamedTuple):
    """How errors name a field, and, where it is encoded, the expression for its value."""

    label: str
    value: str


class Generator(ABC, Generic[V]):
    """Writes the source of a function. V is str, the expression for a value that is decoded, or else None.

    `at` is the position in the payload. `_run` are numbers that are not packed or unpacked yet, `_residues`
    what the position before them can be modulo 8.
    """

    def __init__(self, store: Typestore) -> None:
        self._store = store
        self._lines = ["def function(given):", "    at = 0"]
        self._depth = 1
        self._globals: dict[str, object] = {}
        self._variables = 0
        self._run: list[Number] = []
        self._residues = frozenset({0})

    def function(self, type_name: str) -> Any:
        """Return the function for a message type."""
        self._write_all(type_name)
        exec(compile("\n".join(self._lines), f"<CDR of {type_name}>", "exec"), self._globals)  # noqa: S102
        return self._globals["function"]

    def _write(self, line: str) -> None:
        self._lines.append("    " * self._depth + line)

    def _variable(self, value: str = "") -> str:
        """Return the name of a new variable, with this value."""
        self._variables += 1
        name = f"v{self._variables}"
        if value:
            self._write(f"{name} = {value}")
        return name

    def _constant(self, value: object) -> str:
        """Return the name by which the function knows an object."""
        name = f"c{len(self._globals)}"
        self._globals[name] = value
        return name

    def _values(self, type_name: str, message: str) -> list[V]:
        """Write what encodes or decodes the fields of a message."""
        return [
            self._value(Field(f"field {name!r} of {type_name}", f"{message}.{name}"), form)
            for name, form in fields_of(self._store, type_name)
        ]

    def _value(self, field: Field, form: FieldDesc) -> V:
        if form[0] == Nodetype.NAME:
            return self._message(field, form[1])
        if form[0] == Nodetype.BASE:
            if is_string(form):
                return self._string(field, form[1][1])
            return self._number(field, _CODES[number(form).str[1:]])
        element, length = form[1]
        size = length if form[0] == Nodetype.ARRAY else None
        if is_number(element):
            return self._array(field, element, size, length)
        return self._list(field, element, size, length)

    def _end_run(self) -> None:
        """Write how the numbers of the run are packed or unpacked."""
        if self._run:
            structures = {residue: _structure(self._run, residue) for residue in self._residues}
            self._pack([each.value for each in self._run if each.value], structures)
            self._residues = frozenset((at + each.size) % _MAXALIGN for at, each in structures.items())
            self._run = []

    def _chosen(self, structures: dict[int, struct.Struct], part: Callable[[struct.Struct], object]) -> str:
        """Return the expression for a part of the structure that fits the position."""
        first, *others = structures.values()
        if all(other.format == first.format for other in others):
            return self._constant(part(first))
        table = [part(structures[at]) if at in structures else None for at in range(_MAXALIGN)]
        return f"{self._constant(table)}[at & {_MAXALIGN - 1}]"

    def _align(self, itemsize: int, size: int | None, count: str) -> None:
        """End the run, and write what aligns the numbers of an array of `count` elements that come next."""
        if size is not None:  # in one with the numbers before it, which costs least
            self._run.append(Number("", itemsize, None))
        self._end_run()
        aligned = len(ENCAPSULATION) % itemsize
        if any(residue % itemsize != aligned for residue in self._residues):
            # An empty sequence is not aligned.
            self._pad(f"({len(ENCAPSULATION)} - at) % {itemsize} if {count} else 0")
            self._residues |= {aligned}
        counts = range(_MAXALIGN) if size is None else (size,)
        self._residues = frozenset(
            (residue + each * itemsize) % _MAXALIGN for residue in self._residues for each in counts
        )

    @abstractmethod
    def _write_all(self, type_name: str) -> None: ...

    @abstractmethod
    def _pack(self, values: list[str], structures: dict[int, struct.Struct]) -> None: ...

    @abstractmethod
    def _pad(self, count: str) -> None: ...

    @abstractmethod
    def _message(self, field: Field, type_name: str) -> V: ...

    @abstractmethod
    def _number(self, field: Field, code: str) -> V: ...

    @abstractmethod
    def _string(self, field: Field, most: int) -> V: ...

    @abstractmethod
    def _array(self, field: Field, element: FieldDesc, size: int | None, most: int) -> V: ...

    @abstractmethod
    def _list(self, field: Field, element: FieldDesc, size: int | None, most: int) -> V: ...


def _structure(run: list[Number], residue: int) -> struct.Struct:
    """Return how the numbers lie from a position on, of which the residue modulo 8 suffices."""
    layout, at = "<", residue
    for each in run:
        padding = (len(ENCAPSULATION) - at) % each.alignment
        layout += "x" * padding + each.code
        at += padding + struct.calcsize(f"<{each.code}")
    return struct.Struct(layout)
