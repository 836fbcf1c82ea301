"""Names from elsewhere are only text on our consoles."""

from __future__ import annotations

import io

from rich.table import Table
from rich.text import Text

from reconros_zenoh.cli.console import PlainConsole


def printed(*renderables: object) -> str:
    written = io.StringIO()
    console = PlainConsole(file=written, width=80, force_terminal=True, color_system="standard")
    for renderable in renderables:
        console.print(renderable, highlight=False)
    return written.getvalue()


def test_markup_emoji_and_control_characters_are_text() -> None:
    name = "[/a] [bold]b :smile: \x1b]0;mine\x07\x9b2J"
    shown = "[/a] [bold]b :smile: \\x1b]0;mine\\x9b2J"
    table = Table()
    table.add_column(name)
    table.add_row(name)
    text = printed(name, Text(name), table)
    assert text.startswith(f"{shown}\n{shown}\n")
    assert text.count("[/a]") == text.count(":smile:") == 4
    assert "\x1b]" not in text
    assert "\x9b" not in text


def test_our_own_colours_stay() -> None:
    assert printed(Text("bad", style="red")) == "\x1b[31mbad\x1b[0m\n"
