"""Text that quotes what came from elsewhere, as a terminal may have it."""

from __future__ import annotations


def printable(text: str, *, line_ends: bool = True) -> str:
    """Return the text with what a terminal would obey written out, as Python writes it in a string."""
    kept = "\n" if line_ends else ""
    return "".join(
        letter if letter.isprintable() or letter in kept else letter.encode("unicode_escape").decode()
        for letter in text
    )
