"""The attachment that rmw_zenoh puts beside every message, request and reply."""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple, Self

from reconros_zenoh.errors import BadMessageError

_GID_LENGTH = 16
_LAYOUT = Struct(f"<qqB{_GID_LENGTH}s")


class Attachment(NamedTuple):
    """Who sent a message, when, and as which of its messages.

    `sequence_number` counts from 1 for each publisher or client, `gid` is the 16 bytes of `graph.gid`.
    """

    sequence_number: int
    source_timestamp_ns: int
    gid: bytes

    def encode(self) -> bytes:
        """Return the 33 bytes on the wire: two int64 (little endian), the length 16 of the gid, the gid."""
        return _LAYOUT.pack(self.sequence_number, self.source_timestamp_ns, _GID_LENGTH, self.gid)

    @classmethod
    def decode(cls, data: bytes | None) -> Self:
        """Return the attachment that `data` encodes.

        Raises BadMessageError `no_attachment` when there is none or it is not of this form; releases before
        Jazzy 0.2.4 used another.
        """
        if data is None:
            raise BadMessageError("no_attachment", "the message has no attachment")
        if len(data) != _LAYOUT.size:
            raise BadMessageError(
                "no_attachment", f"the attachment has {len(data)} bytes instead of {_LAYOUT.size}"
            )
        sequence_number, source_timestamp_ns, gid_length, gid = _LAYOUT.unpack(data)
        if gid_length != _GID_LENGTH:
            raise BadMessageError("no_attachment", f"the attachment has a gid of {gid_length} bytes, not 16")
        return cls(sequence_number, source_timestamp_ns, gid)
