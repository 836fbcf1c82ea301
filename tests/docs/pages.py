"""What the pages of the documentation hold, and how their commands are run in the test's process."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from typer.testing import CliRunner

from reconros_zenoh.cli.main import _VERBS, _application

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
_BLOCK = re.compile(r"^```(?P<language>\w*)(?P<rest>[^\n]*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
_APPLICATION = _application(list(_VERBS))


class Block(NamedTuple):
    """A fenced block: what stands behind the fence, and in which line of the page its text begins."""

    language: str
    rest: str
    text: str
    line: int


def blocks(path: Path) -> Iterator[Block]:
    """Go through the fenced blocks of a page."""
    text = path.read_text(encoding="utf-8")
    for match in _BLOCK.finditer(text):
        line = text.count("\n", 0, match.start("text")) + 1
        yield Block(match["language"], match["rest"].strip(), match["text"], line)


def invoke(command: str, *more: str) -> list[str]:
    """Return the lines that the command prints; raise what it raises. Variables may stand before it."""
    words = shlex.split(command, comments=True)
    program = words.index("reconros")
    environment = dict(word.split("=", 1) for word in words[:program])
    result = CliRunner(env=environment).invoke(_APPLICATION, [*words[program + 1 :], *more])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, f"{command}: {result.output}"
    return [line.rstrip() for line in result.stdout.splitlines()]
