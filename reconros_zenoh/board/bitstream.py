"""Partial bitstreams: which callback in which slot, and how many bytes go through the ICAP."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from reconros_zenoh.errors import BitstreamError, UsageError
from reconros_zenoh.text_file import check_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

# magic, slot, length of the callback's name, size of the whole file; then the CRC-32 of all but itself
_HEADER = struct.Struct("<8sQIQ")
_CRC = struct.Struct("<I")
_NAME_AT = _HEADER.size + _CRC.size
_MAGIC = b"RRZBIT02"
_LIMIT_BYTES = 1_000_000_000
_REBUILD = "Write it again with `reconros build`."
_REBUILD_ALIKE = "Write it again with `reconros build`, with the same --profile."


@dataclass(frozen=True, slots=True)
class Bitstream:
    """The bitstream of one callback for one slot; `size` [bytes] is what the ICAP is fed."""

    slot: int
    callback: str
    size: int

    @property
    def file_name(self) -> str:
        """The name under which ReconROS stores it."""
        return f"pblock_slot_{self.slot}_{self.callback}_{self.slot}_partial.bit"

    def write(self, folder: Path) -> Path:
        """Write the file and return its path; the body is a hole of zeros, so it takes no disk space."""
        path = folder / self.file_name
        name = self.callback.encode()
        body = self.size - _NAME_AT - len(name)
        if body < 0:
            raise UsageError(f"a bitstream of {self.size} bytes has no room for its header: {self.file_name}")
        header = _HEADER.pack(_MAGIC, self.slot, len(name), self.size)
        crc = zlib.crc32(bytes(body), zlib.crc32(header + name))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with path.open("wb") as file:
                file.write(header + _CRC.pack(crc) + name)
                file.truncate(self.size)
        except OSError as error:
            raise UsageError(f"{path} cannot be written ({error.strerror}). Choose another folder.") from None
        return path

    @classmethod
    def read(cls, path: Path) -> Bitstream:
        """Return what the file holds; raise BitstreamError when it is damaged, FileError for no file."""
        try:
            check_file(path, _REBUILD, _LIMIT_BYTES)
            content = path.read_bytes()
        except OSError as error:
            raise BitstreamError(path, None, f"cannot be read ({error.strerror}).", _REBUILD) from None
        if len(content) < _NAME_AT or not content.startswith(_MAGIC):
            raise BitstreamError(path, None, "is not a bitstream of this project.", _REBUILD)
        _, slot, name_length, size = _HEADER.unpack_from(content)
        if size != len(content):
            raise BitstreamError(path, None, f"has {len(content)} bytes instead of {size}.", _REBUILD)
        crc = zlib.crc32(memoryview(content)[_NAME_AT:], zlib.crc32(content[: _HEADER.size]))
        if _CRC.unpack_from(content, _HEADER.size) != (crc,):
            raise BitstreamError(path, None, "is damaged (CRC-32 differs).", _REBUILD)
        return cls(slot, content[_NAME_AT : _NAME_AT + name_length].decode(errors="replace"), size)


def read_bitstreams(folder: Path, wanted: Iterable[Bitstream]) -> Mapping[tuple[int, str], Bitstream]:
    """Return the bitstreams that an executor needs from its folder, by slot and callback.

    Raise BitstreamError for one that is missing, damaged, or made for another slot, callback or size.
    """
    found: dict[tuple[int, str], Bitstream] = {}
    for bitstream in wanted:
        path = folder / bitstream.file_name
        content = Bitstream.read(path)
        if (content.slot, content.callback) != (bitstream.slot, bitstream.callback):
            raise BitstreamError(
                path,
                None,
                f"holds callback {content.callback!r} for slot {content.slot}, "
                f"not {bitstream.callback!r} for slot {bitstream.slot}.",
                _REBUILD,
            )
        if content.size != bitstream.size:
            raise BitstreamError(
                path, None, f"has {content.size} bytes; this slot takes {bitstream.size}.", _REBUILD_ALIKE
            )
        found[bitstream.slot, bitstream.callback] = content
    return found
