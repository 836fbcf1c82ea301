"""Reports in HTML: the page, its tables and figures."""

from __future__ import annotations

import re
from html import escape
from itertools import zip_longest
from typing import TYPE_CHECKING

from reconros_zenoh.errors import UsageError
from reconros_zenoh.text_file import replacing

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

_STYLE = """
:root { color-scheme: light dark; --paper: #ffffff; --ink: #24292f; --grey: #8b949e; --line: #d8dee4;
  --soft: #f6f8fa; --good: #1a7f37; --fair: #9a6700; --bad: #cf222e; }
@media (prefers-color-scheme: dark) { :root { --paper: #0f1318; --ink: #e6edf3; --line: #30363d;
  --soft: #171c23; --good: #3fb950; --fair: #d29922; --bad: #ff7b72; } }
body { margin: 0 auto; padding: 1.5rem; max-width: 75rem; background: var(--paper); color: var(--ink);
  font: 1rem/1.55 system-ui, sans-serif; }
h1 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid var(--line); }
p, li, figcaption { max-width: 52rem; }
figure { margin: 1rem 0; } figcaption, .small { font-size: 0.87rem; opacity: 0.85; }
.wide { overflow-x: auto; } .wide svg { display: block; width: 100%; min-width: 56rem; height: auto; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.7rem; border-bottom: 1px solid var(--line); text-align: left; }
th { background: var(--soft); font-weight: 600; }
.number { text-align: right; } td.number { white-space: nowrap; }
.good { color: var(--good); } .fair { color: var(--fair); } .bad { color: var(--bad); }
.bar { display: inline-block; height: 0.7em; background: var(--grey); vertical-align: baseline; }
.warning { border-left: 4px solid var(--bad); background: var(--soft); padding: 0.6rem 1rem; }
/* Paper does not scroll: the widest table fits a sheet. */
@page { size: landscape; }
@media print { :root { font-size: 12px; } .wide { overflow: visible; } figure, tr { break-inside: avoid; }
  h2, h3 { break-after: avoid; } }
"""

_NUMBER = re.compile(r"[-+]?\d|-$|$")

Cell = str | tuple[str, str]
"""A text, or a text and the style class of its cell."""


def table(head: Iterable[str], rows: Iterable[Sequence[Cell]]) -> str:
    """Return a table with these texts, which are never taken for markup; columns of numbers end alike."""
    cells = [[(cell, "") if isinstance(cell, str) else cell for cell in row] for row in rows]
    columns = [
        "number" if all(_NUMBER.match(text) for text, _ in column) else "text"
        for column in zip(*cells, strict=True)
    ]
    titles = zip_longest(head, columns, fillvalue="")
    lines = [_row(f'<th class="{column}">{escape(title)}</th>' for title, column in titles)]
    lines += [
        _row(
            f'<td class="{column} {style}">{escape(text)}</td>'
            for (text, style), column in zip(row, columns, strict=True)
        )
        for row in cells
    ]
    return '<div class="wide"><table>' + "\n".join(lines) + "</table></div>"


def _row(cells: Iterable[str]) -> str:
    return f"<tr>{''.join(cells)}</tr>"


def figure(svg: str, label: str, caption: str) -> str:
    """Return a drawing with its caption; `label` is for those who cannot see it."""
    drawing = svg.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1)
    return f'<figure><div class="wide">{drawing}</div><figcaption>{escape(caption)}</figcaption></figure>'


def write_page(path: Path, title: str, parts: Iterable[str]) -> None:
    """Write one self-contained HTML file with these parts below its title.

    The file is complete or not there: it replaces an older one at the end. Raises UsageError if it cannot be
    written.
    """
    page = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>\n<body>\n"
        + "\n".join([f"<h1>{escape(title)}</h1>", *parts])
        + "\n</body></html>\n"
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial:
            partial.write_text(page, encoding="utf-8", errors="backslashreplace")  # it quotes a command
    except OSError as error:
        raise UsageError(
            f"{path}: the report cannot be written: {error.strerror}. Choose a folder that you may write to."
        ) from error
