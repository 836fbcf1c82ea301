"""The key expressions of Zenoh, without Zenoh."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from reconros_zenoh.errors import TransportError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_CHUNK = r"(?:\*\*?|(?:[^*$?#/]|\$\*)+)"
_WELL_FORMED = re.compile(f"{_CHUNK}(?:/{_CHUNK})*")
_GLYPH = re.compile(r"\$\*|.", re.DOTALL)


def check_key(key: str) -> None:
    """Raise TransportError unless `key` is a well-formed key expression; canonical form is not asked for."""
    if not _WELL_FORMED.fullmatch(key):
        raise TransportError(
            f"{key!r} is not a key expression: chunks without * $ ? # between single slashes; "
            "*, ** and $* are wildcards"
        )


def check_concrete(key: str) -> None:
    """Raise TransportError unless `key` is well-formed and without wildcards.

    Zenoh takes a pattern for a publisher or a querier, but then some servers answer only within one session.
    """
    check_key(key)
    if "*" in key:
        raise TransportError(f"{key} has a wildcard: publish and request on one key at a time")


def intersects(left: str, right: str) -> bool:
    """Whether a key exists that belongs to both expressions.

    `*` is one chunk, `**` any number of chunks, `$*` any text within a chunk; a chunk that begins with `@`
    matches only itself (Zenoh RFC "Key Expressions").
    """
    return left == right or _meet(left.split("/"), right.split("/"), "**", _chunks_meet)


def _chunks_meet(left: str, right: str) -> bool:
    if left == right or _is_any(left, right) or _is_any(right, left):
        return True
    if left.startswith("@") or right.startswith("@"):
        return False
    return _meet(_GLYPH.findall(left), _GLYPH.findall(right), "$*", lambda a, b: a == b or "$*" in {a, b})


def _is_any(wide: str, narrow: str) -> bool:
    return wide in {"*", "**"} and not narrow.startswith("@")


def _meet(left: Sequence[str], right: Sequence[str], many: str, one: Callable[[str, str], bool]) -> bool:
    """Whether two sequences can stand for the same one; `many` stands for any number of elements."""
    if not left or not right:
        return all(element == many for element in (*left, *right))
    if left[0] == many:
        more = one(many, right[0]) and _meet(left, right[1:], many, one)
        return more or _meet(left[1:], right, many, one)
    if right[0] == many:
        return _meet(right, left, many, one)
    return one(left[0], right[0]) and _meet(left[1:], right[1:], many, one)
