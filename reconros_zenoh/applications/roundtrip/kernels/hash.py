"""Hash calculation: SHA-256 of an image (ReconROS Executor, Section V-A)."""

from __future__ import annotations

import functools
import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SOURCE_WORDS = 1920 * 1080 * 3 // 4


@functools.cache
def source() -> NDArray[np.uint32]:
    """Return the image that the board hashes: 1,555,200 words, word i = i; built once and read-only."""
    words = np.arange(SOURCE_WORDS, dtype=np.uint32)
    words.setflags(write=False)
    return words


def sha256(words: NDArray[np.uint32 | np.uint8]) -> NDArray[np.uint32]:
    """Return the SHA-256 digest of `words` as uint32[8].

    The message is the words in little endian, as they stand in the board's memory (or single bytes, if the
    array is uint8). Element 0 of the digest is its first word as FIPS 180-4 defines it: the first four bytes,
    read in big endian.
    """
    message = np.ascontiguousarray(words, words.dtype.newbyteorder("<"))
    return np.frombuffer(hashlib.sha256(message.data).digest(), ">u4").astype(np.uint32)
