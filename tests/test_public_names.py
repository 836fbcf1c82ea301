"""The public names: complete, typed, quick to import, and as the README shows them."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import reconros_zenoh

ROOT = Path(__file__).parents[1]
# Numbers and drawing are loaded by what needs them.
HEAVY = ("numpy", "matplotlib", "pydantic", "rosbags", "simpy", "zenoh", "cv2", "rich", "typer")


@pytest.mark.parametrize("name", reconros_zenoh.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(reconros_zenoh, name).__doc__


def test_every_public_name_has_a_type() -> None:
    tree = ast.parse((ROOT / "reconros_zenoh" / "__init__.py").read_text(encoding="utf-8"))
    (checked,) = [node for node in tree.body if isinstance(node, ast.If)]
    typed = {
        alias.name: f"{node.module}".removeprefix("reconros_zenoh.")
        for node in checked.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    places = {name: place for place, names in reconros_zenoh._PLACES.items() for name in names}
    assert typed == places
    assert sorted(reconros_zenoh.__all__) == sorted([*places, "TMR", "SUB", "SRV", "CLT"])


def test_importing_the_package_loads_nothing_heavy() -> None:
    told = subprocess.run(
        [sys.executable, "-c", "import reconros_zenoh, sys; print(*sys.modules)"],
        check=True,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout.split()
    assert "reconros_zenoh" in told
    assert not set(HEAVY) & set(told)


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'VirtualBord'"):
        _ = reconros_zenoh.VirtualBord  # type: ignore[attr-defined]


def snippets() -> list[str]:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return [
        block
        for block in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
        if block.startswith("import reconros_zenoh as rz")
    ]


def test_the_readme_has_a_program() -> None:
    assert snippets()


@pytest.mark.parametrize("program", snippets())
def test_the_programs_of_the_readme_run(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(program, names)
    assert (tmp_path / "inverse.png").stat().st_size > 1000
    assert len(names["times_ms"]) == 1000  # type: ignore[arg-type]
