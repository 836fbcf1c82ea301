"""Every snippet of docs/ runs and prints what the page says.

A block of docs/ is marked behind its opening fence. ```python runs, all of a page in one namespace. With the
name of a file behind the language (```ini robot/build.cfg) a block is written there first. ```console holds
commands of `reconros` behind `$ `, and below each one lines of what it prints; `...` stands for any lines.
The commands of a console block marked `terminals` are processes, at a router of the test's; those that run
until Ctrl-C get it at the end. Everything happens in a folder of its own.
"""

from __future__ import annotations

import re
import shlex
import signal
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest
from pages import README, ROOT, blocks, invoke
from processes import Process, run

from reconros_zenoh.experiments.endpoints import free_endpoint

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PAGES = sorted((ROOT / "docs").glob("*.md"))


def transcript(text: str) -> Iterator[tuple[str, list[str]]]:
    """Go through the commands of a console block, each with the lines that the page shows below it."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, *shown = part.splitlines()
        yield command, [line.rstrip() for line in shown if line.strip()]


def check_output(printed: list[str], shown: list[str], place: str) -> None:
    """Find what is shown among what was printed: line after line, any lines in between where `...` stands."""
    rest = [line for line in printed if line]
    anywhere = False
    for line in shown:
        if line.strip() == "...":
            anywhere = True
            continue
        assert line in rest, f"{place}: {line!r} is not printed there: {rest}"
        at = rest.index(line)
        assert anywhere or at == 0, f"{place}: before {line!r} stands {rest[:at]}"
        rest, anywhere = rest[at + 1 :], False


def run_in_terminals(text: str, place: str) -> None:
    """Run each command as a process and end those that go on."""
    endpoint = free_endpoint()
    with ExitStack() as terminals:
        running = []
        for command, shown in transcript(text):
            verb, *arguments = shlex.split(command, comments=True)[1:]
            if verb in {"router", "run", "board"}:
                there, ready = ("--listen", "listens") if verb == "router" else ("--router", "serves")
                process = terminals.enter_context(Process(verb, *arguments, there, endpoint))
                process.wait_for(ready)
                running.append(process)
            else:
                done = run(verb, *arguments, "--router", endpoint)
                assert done.returncode == 0, f"{place}: {command}: {done.stderr}"
                check_output(done.stdout.splitlines(), shown or ["..."], place)
        for process in reversed(running):
            assert process.end(signal.SIGINT) == 0, f"{place}: {process}"


def test_every_page_is_found_from_the_readme() -> None:
    assert PAGES
    readme = README.read_text(encoding="utf-8")
    assert [page.name for page in PAGES if f"docs/{page.name}" not in readme] == []


@pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
def test_the_snippets_of_a_page(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    names: dict[str, object] = {"__name__": page.stem}
    ran = 0
    for block in blocks(page):
        place = f"{page.name}:{block.line}"
        if block.language == "console":
            assert block.rest in {"", "terminals"}, place
            if block.rest:
                run_in_terminals(block.text, place)
            else:
                for command, shown in transcript(block.text):
                    check_output(invoke(command), shown, place)
            ran += 1
        elif block.rest:
            path = tmp_path / block.rest
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            # Behind empty lines, so that an error names the line of the page.
            exec(compile("\n" * (block.line - 1) + block.text, str(page), "exec"), names)
            ran += 1
    assert ran


@pytest.mark.parametrize("page", [README, *PAGES], ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []


def test_pictures_of_the_pages_are_small() -> None:
    pictures = [path for path in (ROOT / "docs").iterdir() if path.suffix != ".md"]
    assert pictures
    assert {path.name: path.stat().st_size for path in pictures if path.stat().st_size > 150_000} == {}


def test_output_that_differs_is_noticed() -> None:
    check_output(["a", "", "b", "c"], ["a", "...", "c"], "here")
    with pytest.raises(AssertionError, match="is not printed"):
        check_output(["a"], ["b"], "here")
    with pytest.raises(AssertionError, match="before 'b' stands"):
        check_output(["a", "b"], ["b"], "here")
