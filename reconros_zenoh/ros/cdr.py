"""CDR (XCDR1, little endian): a message type becomes two functions, one that encodes and one that decodes.

Deviation: not the serialisation of rosbags, which goes field by field. Between processes that take each
other's caches an image of 8 KiB spent 60 us in it on its way to a board and back. Here numbers that follow
each other, those of messages within included, are packed by one `struct`; where padding is needed depends on
the position, so there is one for each position modulo 8.
"""

from __future__ import annotations

import reprlib
import struct
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

import numpy as np

from reconros_zenoh.ros.cdr_generator import ANYWHERE, ENCAPSULATION, Field, Generator, Number
from reconros_zenoh.ros.forms import is_string, number

if TYPE_CHECKING:
    from collections.abc import Callable

    from rosbags.interfaces.typing import FieldDesc
    from rosbags.typesys.store import Typestore

Encode: TypeAlias = "Callable[[object], tuple[bytes, np.ndarray[Any, Any] | None]]"
Decode: TypeAlias = "Callable[[bytes | memoryview], Any]"

ENCODE_ERRORS = (AttributeError, TypeError, ValueError, OverflowError, struct.error)
DECODE_ERRORS = (ValueError, IndexError, struct.error)


_ZEROS = [bytes(count) for count in range(8)]


class FieldError(TypeError):
    """A field that does not fit, by its name."""


def encoder(store: Typestore, type_name: str) -> Encode:
    """Return a function from a message to its payload; an array of numbers at the end stays apart.

    It raises one of ENCODE_ERRORS for fields that do not fit, FieldError if it knows which.
    """
    function: Encode = _Encoder(store).function(type_name)
    return function


def decoder(store: Typestore, type_name: str) -> Decode:
    """Return a function from a payload to the message.

    Arrays of numbers are views of the payload; the encapsulation is not looked at. It raises one of
    DECODE_ERRORS when something does not fit into the payload, UnicodeDecodeError for strings that are not
    UTF-8.
    """
    function: Decode = _Decoder(store).function(type_name)
    return function


class _Encoder(Generator[None]):
    """`_pieces` are the expressions for the pieces of the payload, `_arrays` those that are arrays."""

    def __init__(self, store: Typestore) -> None:
        super().__init__(store)
        self._pieces: list[str] = []
        self._arrays: dict[str, str] = {}

    def _write_all(self, type_name: str) -> None:
        self._run.append(Number(f"{len(ENCAPSULATION)}s", 1, self._constant(ENCAPSULATION)))
        self._values(type_name, "given")
        self._end_run()
        last_array = self._arrays.get(self._pieces[-1])
        before = self._pieces[:-1] if last_array else self._pieces
        joined = before[0] if len(before) == 1 else f"b''.join(({', '.join(before)}))"
        self._write(f"return {joined}, {last_array}")

    def _pack(self, values: list[str], structures: dict[int, struct.Struct]) -> None:
        pack = self._chosen(structures, lambda structure: structure.pack)
        self._add_piece(self._variable(f"{pack}({', '.join(values)})"))

    def _pad(self, count: str) -> None:
        self._add_piece(self._variable(f"{self._constant(_ZEROS)}[{count}]"))

    def _add_piece(self, piece: str) -> None:
        self._pieces.append(piece)
        self._write(f"at += len({piece})")

    def _message(self, field: Field, type_name: str) -> None:
        message = self._variable(field.value)
        self._values(type_name, message)

    def _number(self, field: Field, code: str) -> None:
        if code == "?":  # whatever is true would be packed
            self._write(f"if type({field.value}) is not {self._constant(bool)}:")
            self._write(f"    {self._constant(_check_bool)}({field.label!r}, {field.value})")
        self._run.append(Number(code, struct.calcsize(f"<{code}"), field.value))

    def _string(self, field: Field, most: int) -> None:
        if most:
            self._check_length(field, field.value, None, most)
        encoded = self._variable(f"{field.value}.encode()")
        self._run.append(Number("I", 4, f"len({encoded}) + 1"))
        self._end_run()
        self._add_piece(encoded)
        self._residues = ANYWHERE
        self._run.append(Number("x", 1, None))

    def _array(self, field: Field, element: FieldDesc, size: int | None, most: int) -> None:
        dtype = number(element)
        array = self._variable(field.value)
        is_one = f"type({array}) is {self._constant(np.ndarray)} and {array}.dtype is {self._constant(dtype)}"
        self._write(f"if not ({is_one} and {array}.ndim == 1):")
        arguments = f"{field.label!r}, {array}, {self._constant(dtype)}"
        self._write(f"    {array} = {self._constant(_plain_array)}({arguments})")
        self._begin(field, array, size, most)
        self._align(dtype.itemsize, size, f"len({array})")
        piece = f"({array} if {array}.flags.c_contiguous else {array}.tobytes())"
        self._pieces.append(piece)
        self._arrays[piece] = array
        self._write(f"at += {array}.nbytes")

    def _list(self, field: Field, element: FieldDesc, size: int | None, most: int) -> None:
        elements, each = self._variable(field.value), self._variable()
        if is_string(element):
            self._write(f"if isinstance({elements}, str):")
            self._write(f"    {self._constant(_refuse)}({f'{field.label} is a str, not a list of them'!r})")
        self._begin(field, elements, size, most)
        self._end_run()
        joined = self._variable("[]")
        outside, self._pieces = self._pieces, []
        self._residues = ANYWHERE
        self._write(f"for {each} in {elements}:")
        self._depth += 1
        self._value(Field(f"an element of {field.label}", each), element)
        self._end_run()
        self._write(f"{joined} += {', '.join(self._pieces)},")
        self._depth -= 1
        self._pieces, self._residues = outside, ANYWHERE
        self._pieces.append(f"b''.join({joined})")

    def _begin(self, field: Field, elements: str, size: int | None, most: int) -> None:
        """Check how many elements there are, and let their number go before those of a sequence."""
        if most:
            self._check_length(field, elements, size, most)
        if size is None:
            self._run.append(Number("I", 4, f"len({elements})"))

    def _check_length(self, field: Field, value: str, size: int | None, most: int) -> None:
        wanted = f"at most {most}" if size is None else most
        self._write(f"if len({value}) {'>' if size is None else '!='} {most}:")
        problem = f"{f'{field.label} is of length %d, not {wanted}'!r} % len({value})"
        self._write(f"    {self._constant(_refuse)}({problem})")


class _Decoder(Generator[str]):
    def _write_all(self, type_name: str) -> None:
        self._run.append(Number(f"{len(ENCAPSULATION)}x", 1, None))
        message = self._message(Field("", ""), type_name)
        self._end_run()
        self._write(f"return {message}")

    def _pack(self, values: list[str], structures: dict[int, struct.Struct]) -> None:
        unpack = self._chosen(structures, lambda structure: (structure.unpack_from, structure.size))
        self._write(f"unpack, size = {unpack}")
        if values:
            self._write(f"{', '.join(values)}, = unpack(given, at)")
        self._write("at += size")

    def _pad(self, count: str) -> None:
        self._write(f"at += {count}")

    def _message(self, field: Field, type_name: str) -> str:
        values = self._values(type_name, field.value)
        return f"{self._constant(self._store.types[type_name])}({', '.join(values)})"

    def _number(self, field: Field, code: str) -> str:  # noqa: ARG002 # it has no value yet
        value = self._variable()
        self._run.append(Number(code, struct.calcsize(f"<{code}"), value))
        return value

    def _string(self, field: Field, most: int) -> str:  # noqa: ARG002 # a longer one does no harm
        length = self._number(field, "I")
        self._end_run()
        self._write(f"end = at + {length}")
        self._write(f"if not {length} or given[end - 1]:")
        self._write(f"    raise ValueError({f'{field.label} does not end with a zero'!r})")
        value = self._variable("str(given[at : end - 1], 'utf-8')")
        self._write("at = end")
        self._residues = ANYWHERE
        return value

    def _array(self, field: Field, element: FieldDesc, size: int | None, most: int) -> str:
        dtype = number(element)
        count = self._count(field, size, most)
        self._align(dtype.itemsize, size, count)
        arguments = f"given, {self._constant(dtype)}, {count}, at"
        array = self._variable(f"{self._constant(np.frombuffer)}({arguments})")
        self._write(f"at += {array}.nbytes")
        return array

    def _list(self, field: Field, element: FieldDesc, size: int | None, most: int) -> str:
        count = self._count(field, size, most)
        self._end_run()
        elements = self._variable("[]")
        self._residues = ANYWHERE
        self._write(f"for _ in range({count}):")
        self._depth += 1
        value = self._value(field, element)
        self._end_run()
        self._write(f"{elements}.append({value})")
        self._depth -= 1
        self._residues = ANYWHERE
        return elements

    def _count(self, field: Field, size: int | None, most: int) -> str:
        """Return how many elements there are; those of a bounded sequence are checked."""
        if size is not None:
            return str(size)
        count = self._number(field, "I")
        if most:
            self._end_run()
            self._write(f"if {count} > {most}:")
            self._write(f"    raise ValueError({f'{field.label} has more than {most} elements'!r})")
        return count


def _plain_array(label: str, array: Any, dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
    """Return an array whose methods are those of NumPy: a masked one has others."""
    is_array = isinstance(array, np.ndarray)
    if not is_array or array.dtype != dtype:
        found = f"an array of {array.dtype}" if is_array else f"a {type(array).__name__}"
        _refuse(f"{label} is {found}, not an array of {dtype}")
    if array.ndim != 1:
        _refuse(f"{label} has {array.ndim} dimensions, not one")
    return np.asarray(array)


def _check_bool(label: str, value: object) -> None:
    if not isinstance(value, bool | np.bool_):
        _refuse(f"{label} is {reprlib.repr(value)}, not a bool")


def _refuse(problem: str) -> NoReturn:
    raise FieldError(problem)
