"""README.md does what it says: its commands run in their order, with less to do, and its snippet too.

What needs processes runs against a router of the test's. Left out is only what takes long and is a test of
its own: experiments in wall time (tests/system), `up` and `down` (tests/deploy).
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import signal
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest
from pages import README, ROOT, blocks, invoke
from processes import Process, run
from rosbags.rosbag2 import Writer

from reconros_zenoh.applications.roundtrip.kernels.mnist import MODEL
from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.ros.type_registry import TypeRegistry

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

COMMAND = re.compile(r"(\w+=\S+ )*reconros ")
LEFT_OUT = re.compile(r".*reconros (up|down)\b|.*--clock wall|reconros experiment gateway --profile native")
PROCESS = re.compile(r"reconros (router|board|client|status|gateway|map --live|run blink --mapping)\b")
SHORTER = {
    "experiment roundtrip": ("--requests", "2"),
    "experiment design": ("--seconds", "2"),
    "experiment callbacks": ("--repeat", "1"),
    "experiment driving": ("--pictures", "20"),
    "experiment gateway": ("--repeat", "1", "--sizes", "10kB", "--subscribers", "2"),
    "simulate -f deploy/roundtrip.yaml": ("--requests", "1", "--boards", "2"),
    "calibrate": ("--rounds", "1", "--requests", "20"),
    "run blink --clock virtual": ("--seconds", "1"),
}
LISTENERS = {
    "router": ("--listen", "listens"),
    "board": ("--router", "serves"),
    "run": ("--router", "serves"),
}


def commands() -> list[str]:
    """Return the command lines of the page, in their order and without comments."""
    lines = [line for block in blocks(README) for line in block.text.splitlines()]
    return [shlex.join(shlex.split(line, comments=True)) for line in lines if COMMAND.match(line)]


def in_this_process() -> list[str]:
    return [command for command in commands() if not LEFT_OUT.match(command) and not PROCESS.match(command)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Go to a folder with what the reader has: the sources, a mapping, a project, measurements."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PICTURES", "3")
    for name in ("reconros_zenoh", "deploy"):
        (tmp_path / name).symlink_to(ROOT / name)
    (mapping,) = (block.text for block in blocks(README) if block.language == "toml")
    (tmp_path / "my.toml").write_text(mapping, encoding="utf-8")
    shutil.copytree(application_folder(), tmp_path / "my_project")
    shutil.copy(MODEL.parents[1] / "data" / "digits.npz", tmp_path)
    word = TypeRegistry().message("std_msgs/msg/UInt32")
    with Writer(tmp_path / "recording", version=9) as bag:
        angle = bag.add_connection("/angle", word.name, msgdef="uint32 data", rihs01=word.type_hash)
        for at_ns in (0, 500_000_000):
            bag.write(angle, at_ns, b"".join(word.encode(word.cls(data=80))))
    (tmp_path / "times.csv").write_text("2.5\n2.6\n41\n", encoding="utf-8")
    return tmp_path


def test_the_commands_run_in_their_order(folder: Path) -> None:
    # What `make demo` leaves, and what the reader has measured.
    invoke("reconros experiment roundtrip --clock virtual --requests 20 --out results/demo")
    shutil.copytree("results/demo/virtual", "results/demo/wall")
    shutil.copytree("results/demo/virtual/mixed", "measured/mixed")
    for command in in_this_process():
        more = next((more for start, more in SHORTER.items() if command.startswith(f"reconros {start}")), ())
        assert invoke(command, *more), command
    made = ("times.png", "graph.svg", "my-board.toml", "trace.png", "results/virtual/roundtrips.png")
    assert [name for name in made if not (folder / name).stat().st_size] == []
    assert json.loads((folder / "results/virtual/experiment.json").read_text(encoding="utf-8"))


def test_the_commands_with_processes_run_in_their_order(folder: Path) -> None:
    invoke("reconros new blink")
    invoke("reconros build reconros_zenoh/applications/roundtrip --out bitstreams")
    endpoint = free_endpoint()
    with ExitStack() as terminals:
        boards: dict[str, Process] = {}
        for command in filter(PROCESS.match, commands()):
            verb, *arguments = shlex.split(command)[1:]
            if verb in LISTENERS:
                option, ready = LISTENERS[verb]
                name = verb if verb == "router" else (*re.findall("--name (\\w+)", command), "board0")[0]
                if name in boards:  # there can be one of that name
                    assert boards[name].end(signal.SIGINT) == 0, boards[name]
                # Where no link is modelled none loses anything, and the client ends with status 0.
                kind = ("--profile", "native") if command.startswith("reconros board --mapping") else ()
                boards[name] = terminals.enter_context(Process(verb, *arguments, option, endpoint, *kind))
                boards[name].wait_for(ready)
            elif "--listen" not in arguments:
                fewer = ("--requests", "2") if verb == "client" else ()
                done = run(verb, *arguments, *fewer, "--router", endpoint)
                assert (done.returncode, bool(done.stdout)) == (0, True), f"{command}: {done.stderr}"
        for process in reversed(boards.values()):
            assert process.end(signal.SIGINT) == 0, process


def test_most_commands_run() -> None:
    left_out = [command for command in commands() if LEFT_OUT.match(command)]
    assert len(left_out) < len(commands()) / 4


def snippets() -> Iterator[str]:
    return (block.text for block in blocks(README) if block.language == "python")


def test_the_snippet_runs(folder: Path) -> None:
    (snippet,) = snippets()
    exec(compile(snippet, str(README), "exec"), {"__name__": "snippet"})
    assert (folder / "inverse.png").stat().st_size > 0


@pytest.mark.parametrize("command", commands())
def test_a_command_is_there(command: str) -> None:
    invoke(command, "--help")


def test_a_command_that_is_not_there_is_noticed() -> None:
    with pytest.raises(AssertionError, match="No such option"):
        invoke("reconros run blink --mappings software", "--help")
