"""Mistakes in the Python and the interfaces of a project: file, line and remedy."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.errors import FileError, TransportError
from reconros_zenoh.experiments.simulation import Simulation
from reconros_zenoh.project.hosting import BoardOptions
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.project.template import new_project

if TYPE_CHECKING:
    from pathlib import Path


def start(folder: Path) -> None:
    """Put the project on a board."""
    project = load_project(folder)
    with Simulation(project.types()) as simulation:
        simulation.add_board(read_profile("native"), project, project.mapping(None), BoardOptions())


REGISTER = '    app.register("count", "timer", software=count.software, hardware=count.hardware)\n'

GATEWAY = "[ROSGateway@bridge]\nSlot = more(0)\nHWTopic = /a\nSWTopic = /b\nMsgType = blink_msgs/Cuont\n"

# The file that is changed, what is replaced by what, the file and line that must be named, and what is said.
MISTAKES = {
    "syntax of main.py": ("main.py", "def main(app):", "def main(app:", "main.py:6", "SyntaxError"),
    "syntax of another module": (
        "callbacks.py",
        "class Count:",
        "class Count",
        "callbacks.py:4",
        "SyntaxError",
    ),
    "import that does not exist": (
        "main.py",
        "from callbacks import Count",
        "from callback import Count",
        "main.py:3",
        "ModuleNotFoundError: No module named 'callback'",
    ),
    "error while importing": (
        "callbacks.py",
        '"""What',
        '1 / 0\n"""What',
        "callbacks.py:1",
        "ZeroDivisionError",
    ),
    "exit while importing": ("callbacks.py", '"""What', 'exit(0)\n"""What', "callbacks.py:1", "SystemExit"),
    "no function": ("main.py", "=count.hardware", "='hls'", "main.py:8", "'hls', which cannot be called"),
    "no main": ("main.py", "def main", "def start", "main.py", "has no function `main`"),
    "error in main": ("main.py", "app.spin()", "app.spin(1, 2)", "main.py:9", "TypeError"),
    "error in a function that main calls": (
        "callbacks.py",
        "self.count = 0",
        "self.count = zero",
        "callbacks.py:9",
        "NameError",
    ),
    "unknown resource": ("main.py", '"pub"', '"publisher"', "main.py:7", "no resource 'publisher'"),
    "unknown resource of a callback": (
        "main.py",
        '"timer"',
        '"tick"',
        "main.py:8",
        "no resource 'tick' in its groups",
    ),
    "callback without a group": (
        "build.cfg",
        "ResourceGroup = count",
        "",
        "main.py:8",
        "in its groups: none. Correct the name, or `ResourceGroup` of [ReconosThread@count] in build.cfg.",
    ),
    "resource that makes nothing ready": (
        "main.py",
        '"timer"',
        '"pub"',
        "main.py:8",
        "makes no callback ready",
    ),
    "no hardware": ("main.py", ", hardware=count.hardware", "", "main.py:8", "mapped to hardware, but no"),
    "timing of what there is not": (
        "main.py",
        "software=count.software",
        'software_timing=__import__("reconros_zenoh").Cycles(500)',
        "main.py:8",
        "callback 'count' has software_timing, but no `software` that takes it",
    ),
    "timing that the mapping does not need": (
        "main.py",
        "software=count.software",
        "software=count.software, software_timing=500",
        "main.py:8",
        "timing=500 of callback 'count': write Cycles(n) or Native(factor)",
    ),
    "no spin": ("main.py", "    app.spin()\n", "", "main.py", "does not call app.spin()"),
    "callback after spin": (
        "main.py",
        "    app.spin()\n",
        f"    app.spin()\n{REGISTER}",
        "main.py:10",
        "'count' is added to an executor that spins already",
    ),
    "second spin": (
        "main.py",
        "    app.spin()\n",
        "    app.spin()\n    app.spin()\n",
        "main.py:10",
        "the executor spins already",
    ),
    "spin without a callback": ("main.py", REGISTER, "", "main.py:8", "without a callback"),
    "callback that is not in build.cfg": (
        "main.py",
        'register("count"',
        'register("counter"',
        "main.py:8",
        "build.cfg has no callback 'counter'. Add `[ReconosThread@counter]`",
    ),
    "callback that is not in main.py": (
        "build.cfg",
        "[ReconosThread@count]",
        "[ReconosThread@idle]\nSwSource = c\n[ReconosThread@count]",
        "build.cfg:24",
        "adds no callback 'idle'",
    ),
    "type that nobody defines": (
        "build.cfg",
        "msg, Count",
        "msg, Cuont",
        "build.cfg:22",
        "pub: The type 'blink_msgs/msg/Cuont' is not known; similar are blink_msgs/msg/Count",
    ),
    "type of a gateway that nobody defines": (
        "build.cfg",
        "[ResourceGroup@count]",
        f"[HwSlot@more(0:0)]\nId = 1\n{GATEWAY}[ResourceGroup@count]",
        "build.cfg:20",
        "bridge: The type 'blink_msgs/msg/Cuont' is not known",
    ),
    "more workers than slots": (
        "mappings/hardware.toml",
        "software_workers = 2",
        "software_workers = 2\nhardware_workers = 2",
        "mappings/hardware.toml:3",
        "hardware_workers = 2 is more than the slots of the project: 1",
    ),
    "syntax of a message": (
        "msg/blink_msgs/msg/Count.msg",
        "uint32",
        "uint33",
        "Count.msg:1",
        "'uint33' is no type",
    ),
    "wide string": (
        "msg/blink_msgs/msg/Count.msg",
        "uint32",
        "wstring",
        "Count.msg:1",
        "wstring is not supported",
    ),
}


@pytest.mark.parametrize(("file", "old", "new", "place", "said"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_named_with_its_place(
    tmp_path: Path, file: str, old: str, new: str, place: str, said: str
) -> None:
    folder = tmp_path / "blink"
    new_project(folder)
    path = folder / file
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    if "idle" in new:
        (folder / "mappings" / "hardware.toml").unlink()
        (folder / "mappings" / "software.toml").unlink()
    modules, places = set(sys.modules), list(sys.path)
    with pytest.raises(FileError) as caught:
        start(folder)
    assert f"/{place}: " in str(caught.value)
    assert said in str(caught.value)
    assert "callbacks" not in set(sys.modules) - modules
    assert sys.path == places


def test_what_is_no_mistake_of_the_project_keeps_its_words(tmp_path: Path) -> None:
    new_project(tmp_path / "blink")
    (tmp_path / "blink" / "main.py").write_text(
        "from reconros_zenoh.errors import TransportError\n"
        "def main(app):\n"
        "    raise TransportError('no router')\n",
        encoding="utf-8",
    )
    with pytest.raises(TransportError, match=r"^no router$"):
        start(tmp_path / "blink")


def test_a_second_spin_beside_a_gateway(tmp_path: Path) -> None:
    folder = tmp_path / "blink"
    new_project(folder)
    with (folder / "build.cfg").open("a", encoding="utf-8") as file:
        file.write("[HwSlot@more(0:0)]\nId = 1\n" + GATEWAY.replace("Cuont", "Count"))
    start(folder)
    with (folder / "main.py").open("a", encoding="utf-8") as file:
        file.write("    app.spin()\n")
    with pytest.raises(FileError, match=r"main\.py:10: the executor spins already\. Call app\.spin\(\) once"):
        start(folder)


def test_a_callback_of_ones_own_executor_that_is_not_in_build_cfg(tmp_path: Path) -> None:
    folder = tmp_path / "blink"
    new_project(folder)
    (folder / "main.py").write_text(
        "from reconros_zenoh.board.executor import Executor\n"
        "from reconros_zenoh.executor.callbacks import CallbackKind\n"
        "def main(app):\n"
        "    executor = Executor(app.board, 1, 0)\n"
        "    for name in ('count', 'extra'):\n"
        "        executor.add_sw_callback(\n"
        "            name, CallbackKind.TMR, app.source('count', 'timer'), print\n"
        "        )\n"
        "    app.spin(executor)\n",
        encoding="utf-8",
    )
    with pytest.raises(
        FileError, match=r"main\.py:5: The callback 'extra' is not in build\.cfg\. Add a section"
    ):
        start(folder)


def test_a_project_by_a_relative_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    new_project(tmp_path / "blink")
    (tmp_path / "blink" / "callbacks.py").write_text("1 / 0\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match=r"^blink/callbacks\.py:1: ZeroDivisionError"):
        load_project(tmp_path.joinpath("blink").relative_to(tmp_path))


@pytest.mark.parametrize("package", ["steps", "steps_without_init"])
def test_modules_of_a_project_are_forgotten_and_those_of_its_environment_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    new_project(tmp_path / "blink")
    site = tmp_path / "blink" / ".venv" / "site-packages"
    for folder in (site, tmp_path / "blink" / package):
        folder.mkdir(parents=True)
    if package == "steps":
        (tmp_path / "blink" / package / "__init__.py").touch()
    (tmp_path / "blink" / package / "first.py").touch()
    (site / "installed_there.py").write_text("def fail():\n    raise ValueError('no')\n", encoding="utf-8")
    main = tmp_path / "blink" / "main.py"
    main.write_text(
        f"import {package}.first\nimport installed_there\ndef main(app):\n    installed_there.fail()\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(site)
    with pytest.raises(FileError, match=r"main\.py:4: ValueError: no"):
        start(tmp_path / "blink")
    assert not {package, f"{package}.first"} & set(sys.modules)
    assert sys.modules.pop("installed_there")


def test_without_mapping_files_the_places_are_checked_too(tmp_path: Path) -> None:
    folder = tmp_path / "blink"
    new_project(folder)
    for path in (folder / "mappings").iterdir():
        path.unlink()
    path = folder / "build.cfg"
    text = path.read_text(encoding="utf-8").replace("HwSource = hls\n", "")
    path.write_text(
        text.replace('node, count_msg, "/count"', "node, blink_msgs/Count, /count, hw"), encoding="utf-8"
    )
    with pytest.raises(FileError, match=r"build\.cfg:22: The callback count is mapped to software"):
        start(folder)


def test_a_service_whose_name_ros_does_not_allow_is_named_with_its_line(tmp_path: Path) -> None:
    folder = tmp_path / "blink"
    new_project(folder)
    declared = "flip_msg = rossrvmsg, std_srvs, srv, SetBool\nflip = rossrvc, node, flip_msg, /1st\n"
    for file, old, new in (
        ("build.cfg", "[ReconosThread", f"{declared}[ReconosThread"),
        ("main.py", "    app.spin", '    app.client("count", "flip")\n    app.spin'),
    ):
        text = (folder / file).read_text(encoding="utf-8")
        (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(FileError, match=r"build\.cfg:25: .*'/1st' has a part that begins with a digit"):
        start(folder)
